"""The gate's lines, with a clock of the test's own."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ik_client.gate import GateLimits, PoseGate, Verdict
from ik_client.hand import HandSample
from ik_client.rotation import rotation_matrix, turn

TICK = 0.01
EYE = np.eye(4)


def pose(x=0.0, angle=0.0):
    T = np.eye(4)
    T[0, 3] = x
    T[:3, :3] = rotation_matrix(np.array([0.0, 0.0, angle]))
    return T


class Hand:
    """A gate that is fed a sample a tick."""

    def __init__(self, **limits) -> None:
        self.gate = PoseGate(GateLimits(**limits))
        self.now = 100.0
        self.count = 0
        self.sample: HandSample | None = None

    def new(self, T, dt=TICK, *, stamp: float | None = None, tracked=True) -> Verdict:
        """A new sample in the next tick."""
        self.count += 1
        self.sample = HandSample(T, True, self.count if stamp is None else stamp, tracked)
        return self.same(dt)

    def same(self, dt=TICK) -> Verdict:
        """The next tick, without news."""
        self.now += dt
        return self.check()

    def check(self) -> Verdict:
        self.gated = self.gate.check(self.sample, self.now)
        assert (self.gated.pose is not None) == (self.gated.verdict is Verdict.OK)
        return self.gated.verdict


def test_a_hand_that_moves_like_a_hand_passes():
    hand = Hand()
    for k in range(200):
        T = pose(0.3 * math.sin(0.05 * k), 0.5 * math.sin(0.03 * k))
        assert hand.new(T) is Verdict.OK
        np.testing.assert_array_equal(hand.gated.pose, T)


def test_a_sample_is_stale_after_its_age_to_the_tick():
    """Hazard row "stale target": 0.1 s, the boundary at a tick on either side; gone after 0.5 s."""
    hand = Hand()
    hand.now = 0.0
    assert hand.new(EYE, dt=0.0) is Verdict.OK
    verdicts = {}
    for milliseconds in range(5, 1000, 5):
        hand.now = milliseconds / 1000
        verdicts[milliseconds] = hand.check()
    assert {verdicts[ms] for ms in verdicts if ms <= 100} == {Verdict.OK}
    assert {verdicts[ms] for ms in verdicts if 100 < ms <= 500} == {Verdict.STALE}
    assert {verdicts[ms] for ms in verdicts if ms > 500} == {Verdict.GONE}


@given(
    st.lists(st.floats() | st.floats(-1e9, 1e9), min_size=25, max_size=25), st.sampled_from([3600.0, -3600.0, 1e300])
)
def test_stamps_change_nothing(stamps, skew):
    """Hazard rows "stale target" and "clock skew": the sender's clock may be an hour off, step, or be no number."""

    def verdicts(stamp):
        hand = Hand()
        news = [hand.new(pose(0.001 * k), stamp=stamp(k)) for k in range(25)]
        return news + [hand.same() for _ in range(60)]

    expected = verdicts(lambda k: k * TICK)
    assert expected[:25] == [Verdict.OK] * 25
    assert expected[-1] is Verdict.GONE
    assert verdicts(lambda k: stamps[k]) == expected
    assert verdicts(lambda k: k * TICK + skew) == expected
    assert verdicts(lambda k: -k * TICK) == expected


def test_a_dead_sender_with_no_number_for_a_stamp_goes_stale_too():
    hand = Hand()
    hand.new(EYE, stamp=float("nan"))
    for _ in range(20):
        hand.sample = HandSample(EYE, True, float("nan"))  # another object each time, which does not equal the last
        verdict = hand.same()
    assert verdict is Verdict.STALE


def test_a_loop_that_stalls_has_lost_the_hand():
    """Hazard row "loop overrun": what came during the stall was not seen, so the next sample may be anywhere."""
    for stall, verdict in ((0.09, Verdict.OK), (0.3, Verdict.STALE), (0.6, Verdict.GONE)):
        hand = Hand()
        hand.new(EYE)
        assert hand.new(pose(0.01), dt=stall) is verdict
        assert hand.same() is Verdict.OK


def test_a_clock_that_steps_back_makes_samples_stale_not_eternal():
    """Hazard row "clock skew"."""
    hand = Hand()
    hand.new(EYE)
    hand.now -= 50.0
    assert hand.check() in (Verdict.STALE, Verdict.GONE)
    hand.new(pose(0.001))
    assert hand.same() is Verdict.OK
    hand.now = math.nan
    assert hand.check() is not Verdict.OK


NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


@given(
    hnp.arrays(np.float64, (4, 4), elements=NUMBERS),
    st.integers(0, 15),
    st.sampled_from([math.nan, math.inf, -math.inf]),
)
def test_no_number_passes_as_a_pose(T, where, number):
    """Hazard row "NaN / Inf": refused whatever else is in the matrix, and the next good sample is none the worse."""
    T.flat[where] = number
    hand = Hand()
    hand.new(EYE)
    assert hand.new(T) is Verdict.INVALID
    assert hand.new(pose(0.001)) is Verdict.OK


NO_ROTATIONS = {
    "rank one": np.full((3, 3), 1 / 3),
    "rank one with unit rows": np.full((3, 3), 1 / math.sqrt(3)),
    "twice the identity": 2.0 * np.eye(3),
    "reflection": np.diag([1.0, 1.0, -1.0]),
    "shear": np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    "zero": np.zeros((3, 3)),
}


@pytest.mark.parametrize("R", NO_ROTATIONS.values(), ids=NO_ROTATIONS)
def test_what_is_no_rotation_is_no_pose(R):
    """Hazard row "non-orthonormal / reflected"."""
    hand = Hand()
    T = np.eye(4)
    T[:3, :3] = R
    assert hand.new(T) in (Verdict.INVALID, Verdict.GONE)
    assert hand.gated.pose is None


def test_nearly_a_rotation_is_made_one():
    """Hazard row "non-orthonormal / reflected": what float32 leaves is projected."""
    hand = Hand()
    T = pose(0.1, 1.0)
    T[:3, :3] += 1e-5 * np.random.default_rng(0).normal(size=(3, 3))
    assert hand.new(T) is Verdict.OK
    assert hand.gated.pose is not None
    R = hand.gated.pose[:3, :3]
    np.testing.assert_allclose(R.T @ R, np.eye(3), rtol=0, atol=1e-14)


@pytest.mark.parametrize("T", [None, "pose", np.eye(3), np.zeros((4, 4, 4)), [[1, 2], [3]], np.full((4, 4), None)])
def test_what_is_no_matrix_is_no_pose(T):
    hand = Hand()
    hand.new(EYE)
    assert hand.new(T) is Verdict.INVALID


def test_what_the_tracker_does_not_see_is_lost():
    hand = Hand()
    hand.new(EYE)
    assert hand.new(pose(0.001), tracked=False) is Verdict.UNTRACKED
    assert hand.new(pose(0.002)) is Verdict.OK
    hand.sample = None
    verdicts = [hand.same() for _ in range(60)]
    assert verdicts[:49] == [Verdict.MISSING] * 49
    assert verdicts[-1] is Verdict.GONE


def test_a_glitch_is_rejected_and_what_returns_passes():
    """Hazard row "teleporting target": one frame 73 cm off while the tracker claims to track."""
    hand = Hand()
    for k in range(10):
        hand.new(pose(0.001 * k))
    assert hand.new(pose(0.73)) is Verdict.JUMP
    assert hand.same() is Verdict.JUMP  # seen again, not forgiven
    assert hand.new(pose(0.012)) is Verdict.OK
    assert hand.new(pose(0.013)) is Verdict.OK


def test_a_hand_that_is_somewhere_else_has_moved():
    """Hazard row "teleporting target": three consistent frames at the new place need a new grip."""
    hand = Hand()
    hand.new(EYE)
    verdicts = [hand.new(pose(0.5 + 0.001 * k)) for k in range(6)]
    assert verdicts == [Verdict.JUMP, Verdict.JUMP, Verdict.MOVED, Verdict.OK, Verdict.OK, Verdict.OK]
    assert Verdict.MOVED.revokes
    assert Verdict.GONE.revokes
    assert not Verdict.JUMP.revokes


def test_waiting_lets_no_jump_through():
    """Slow trackers, such as cameras: a step may be as long as one interval allows, however many were rejected."""
    hand = Hand()
    hand.new(EYE, dt=0.033)
    assert [hand.new(pose(0.25 + 1e-4 * k), dt=0.033) for k in range(3)] == [Verdict.JUMP, Verdict.JUMP, Verdict.MOVED]


@pytest.mark.parametrize(("speed", "verdict"), [(2.9, Verdict.OK), (3.1, Verdict.JUMP)])
def test_the_line_is_at_the_speed_of_a_hand(speed, verdict):
    """Hazard row "teleporting target": a ramp just below 3 m/s passes, just above does not."""
    hand = Hand()
    hand.new(EYE, dt=0.03)
    assert hand.new(pose(0.03 * speed), dt=0.03) is verdict


@pytest.mark.parametrize(("speed", "verdict"), [(11.9, Verdict.OK), (12.1, Verdict.JUMP)])
def test_the_line_is_at_the_turn_of_a_hand(speed, verdict):
    hand = Hand()
    hand.new(EYE, dt=0.03)
    assert hand.new(pose(0.0, 0.03 * speed), dt=0.03) is verdict


def test_jitter_of_arrival_is_no_jump():
    """A hand at 2 m/s, sampled at 90 Hz, whose samples arrive 2 ms or 20 ms apart."""
    hand, x = Hand(), 0.0
    hand.new(EYE)
    for k in range(100):
        x += 2.0 / 90
        assert hand.new(pose(x), dt=0.002 if k % 2 else 0.0202) is Verdict.OK


def test_a_frozen_position_is_a_lost_hand_however_it_turns():
    """Hazard row "teleporting target", frozen pose: 0.5 s without a changed bit, though the gyroscope works."""
    hand = Hand()
    hand.now = 0.0
    verdicts = [hand.new(pose(0.3, 0.001 * k), dt=0.0 if k == 0 else TICK) for k in range(150)]
    assert set(verdicts[:50]) == {Verdict.OK}
    assert Verdict.OK not in verdicts[52:]
    assert verdicts[60] is Verdict.FROZEN
    assert verdicts[-1] is Verdict.GONE
    assert hand.new(pose(0.3 + 1e-15)) is Verdict.OK


def test_a_scripted_hand_may_stand_still():
    hand = Hand(freeze_time=math.inf)
    assert {hand.new(EYE) for _ in range(200)} == {Verdict.OK}


def test_a_tracker_may_write_into_its_array_again():
    """Kept by value: else a jump would be compared with itself."""
    hand = Hand()
    T = pose()
    hand.new(T)
    T[0, 3] = 0.001
    assert hand.new(T) is Verdict.OK
    assert [hand.same() for _ in range(11)][-1] is Verdict.STALE
    T[0, 3] = 0.002
    assert hand.new(T) is Verdict.OK
    T[0, 3] = 0.9
    assert hand.new(T) is Verdict.JUMP


@pytest.mark.parametrize("name", GateLimits.__dataclass_fields__)
@pytest.mark.parametrize("value", [0, -1.0, math.nan])
def test_limits_are_positive(name, value):
    with pytest.raises(ValueError, match=f"the gate's {name} must be positive"):
        PoseGate(GateLimits(**{name: value}))


STEP = st.sampled_from([0.0, 1e-3, 0.02, 0.059, 0.061, 0.3, 2.0])
SAMPLES = st.sampled_from(["new", "new", "new", "same", "missing", "untracked", "nan"])


@given(
    st.lists(
        st.tuples(SAMPLES, STEP, st.floats(-0.5, 0.5), st.sampled_from([0.001, 0.01, 0.02, 0.11, 0.7])), max_size=60
    )
)
def test_what_passes_is_fresh_tracked_and_continuous(ticks):
    """The promise that the clutch relies on, for any sequence of samples."""
    hand, x, angle = Hand(), 0.0, 0.0
    arrived, before, unbroken = -math.inf, None, False
    for what, step, twist, dt in ticks:
        if what != "same":
            x, angle = x + step, angle + twist
        match what:
            case "new":
                verdict = hand.new(pose(x, angle), dt)
            case "untracked":
                verdict = hand.new(pose(x, angle), dt, tracked=False)
            case "nan":
                verdict = hand.new(np.full((4, 4), np.nan), dt)
            case "missing":
                hand.sample = None
                verdict = hand.same(dt)
            case _:
                verdict = hand.same(dt)
        interval = hand.now - arrived
        arrived = hand.now if what in ("new", "untracked", "nan") else arrived
        if verdict is Verdict.OK:
            now = hand.gated.pose
            assert now is not None
            assert hand.sample is not None
            assert hand.sample.tracked
            assert np.isfinite(now).all()
            assert hand.now - arrived <= 0.1
            if unbroken and before is not None:
                span = max(interval, 0.02) if what == "new" else 0.0
                assert np.linalg.norm(now[:3, 3] - before[:3, 3]) <= 3.0 * span + 1e-12
                assert turn(before[:3, :3], now[:3, :3]) <= 12.0 * span + 1e-7
            before, unbroken = now, True
        elif verdict is not Verdict.JUMP:
            unbroken = False
