"""The guard and its sources: which of them counts, which of their commands, and by whose clock."""

import numpy as np
import pytest
from guard_bench import HOME, PERIOD, TICKS_OF_THE_RAMP, Bench, N, ramp_towards, speed
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_client.robot_end import EndState, Reception
from ik_client.robot_end.guard import HOLD_AFTER

pytest.importorskip("ruckig")

HOLD_TICKS = round(HOLD_AFTER / PERIOD)
AWAY = np.array([0.3, 0.2, -0.4])


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_another_run_of_the_service_disarms(bench):
    """Hazard rows "service restart" and "duplicate services", at the robot."""
    bench.follow()
    ramp_towards(bench, 10)
    bench.go(50, HOME, engaged=True, boot_id="second")
    assert bench.state is EndState.READY
    assert speed(bench) < 1e-9
    assert bench.guard.tally["disarmed"] == 1
    assert np.abs(bench.q_set - HOME).max() > 0.1
    bench.go(1, engaged=False, boot_id="second")
    bench.go(20, HOME, engaged=True, boot_id="second")
    assert bench.state is EndState.READY, "the way home is too long for an engagement"
    bench.go(1, engaged=False, boot_id="second")
    bench.go(1, engaged=True, boot_id="second")
    assert bench.state is EndState.FOLLOWING


def test_two_services_in_turn_never_move_the_arms_for_long(bench):
    """Hazard row "duplicate services"."""
    bench.follow()
    for _ in range(20):
        bench.go(1, HOME + AWAY, engaged=True, boot_id="second")
        bench.go(1, HOME, engaged=True, boot_id="first")
    assert bench.state is EndState.READY
    assert np.abs(bench.q_set - HOME).max() < 1e-3


def test_the_first_run_of_a_service_is_no_change(bench):
    bench.take()
    bench.go(1, engaged=False, boot_id="")
    bench.go(1, engaged=True, boot_id="")
    bench.go(1, engaged=True, boot_id="first")
    assert bench.state is EndState.FOLLOWING


def test_a_second_session_is_busy_until_the_first_was_silent_for_a_second(bench):
    """Hazard row "two operators"."""
    bench.follow()
    for _ in range(30):
        bench.go(1, HOME, engaged=True)
        assert bench.send(HOME + AWAY, session="b", engaged=True) is Reception.BUSY
    np.testing.assert_allclose(bench.q_set, HOME, atol=1e-9)
    busy = bench.guard.report(bench.q, np.zeros(N), bench.now, None, busy=True)
    assert (busy.ready, busy.following) == (False, False)
    assert "busy" in busy.note
    bench.tick(49)
    assert bench.send(session="b") is Reception.BUSY
    bench.tick(2)
    assert bench.send(session="b") is Reception.ACCEPTED
    assert bench.send(session="a") is Reception.BUSY


def test_a_new_session_starts_disarmed(bench):
    """Hazard row "two operators": what the last one has engaged is not the next one's."""
    bench.follow()
    bench.go(1, engaged=False)
    bench.tick(60)
    bench.go(50, HOME + 0.05, session="b", engaged=True)
    np.testing.assert_array_equal(bench.q_set, HOME)
    assert bench.state is EndState.READY


def test_a_release_frees_the_robot_for_others(bench):
    bench.follow()
    bench.go(1, release=True)
    bench.tick(TICKS_OF_THE_RAMP)
    assert bench.state is EndState.RELEASED
    assert bench.send(session="b") is Reception.ACCEPTED


def test_what_is_old_or_repeated_is_dropped_and_counted(bench):
    """Hazard row "replay / reorder"."""
    bench.follow()
    assert bench.send(HOME, seq=1000, engaged=True) is Reception.ACCEPTED
    bench.tick()
    for seq in (1000, 999, 1, 0):
        assert bench.send(HOME + 0.05, seq=seq, engaged=True) is Reception.OLD
    bench.tick()
    np.testing.assert_array_equal(bench.q_set, HOME)
    assert bench.guard.tally["old"] == 4


def test_old_commands_are_silence(bench):
    """Hazard row "replay / reorder": a recording that is played keeps nothing alive."""
    bench.follow()
    for _ in range(HOLD_TICKS + 1):
        bench.send(HOME, seq=1, engaged=True)
        bench.tick()
    assert bench.state is EndState.HOLDING


@given(st.data())
@settings(max_examples=40)
def test_a_shuffled_recording_is_never_ahead_of_its_newest(data):
    """Hazard row "replay / reorder": the accepted numbers rise, however the commands come."""
    bench = Bench()
    order = data.draw(st.lists(st.integers(0, 30), min_size=1, max_size=60))
    accepted = [seq for seq in order if bench.send(HOME, seq=seq) is Reception.ACCEPTED]
    assert accepted == sorted(set(accepted))
    assert bench.guard.tally["old"] == len(order) - len(accepted)


BAD = [
    {"q": np.full(N, np.nan)},
    {"q": np.array([0.0, np.inf, 0.0])},
    {"q": np.zeros(N + 1)},
    {"q": np.zeros((N, 1))},
    {"q": np.full(N, 1e300)},
    {"tau": np.array([0.0, np.nan, 0.0])},
    {"tau": np.zeros(N - 1)},
]


@pytest.mark.parametrize("fields", BAD)
def test_what_is_no_command_is_counted_and_otherwise_as_if_it_had_not_come(bench, fields):
    """Hazard row "NaN / Inf", at the robot."""
    assert bench.send(**fields) is Reception.BAD
    assert bench.send(session="b") is Reception.ACCEPTED, "it holds no lease"
    bench = Bench()
    bench.follow()
    for _ in range(HOLD_TICKS + 1):
        assert bench.send(engaged=True, **fields) is Reception.BAD
        bench.tick()
    assert bench.state is EndState.HOLDING
    assert bench.guard.tally["bad"] == HOLD_TICKS + 1


@pytest.mark.parametrize("skew", [3600.0, -3600.0, 1e300, -1e300])
def test_the_clock_of_the_sender_does_not_matter(bench, skew):
    """Hazard row "clock skew", at the robot."""
    other = Bench()
    for one, time in ((bench, 0.0), (other, skew)):
        one.follow()
        for k in range(30):
            one.go(1, HOME + AWAY, engaged=True, time=time - k)
        one.tick(40)
    for a, b in zip(bench.setpoints, other.setpoints, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
        assert a.state is b.state


@pytest.mark.parametrize("now", [0.0, np.nan, 1e9])
def test_a_clock_that_jumps_counts_as_silence(bench, now):
    """Hazard row "clock skew", at the robot: whatever its own clock does, the arms hold."""
    bench.follow()
    ramp_towards(bench, 10)
    bench.now = now
    bench.tick()
    assert bench.state is EndState.READY
    bench.tick(20)
    assert speed(bench) < 1e-9
