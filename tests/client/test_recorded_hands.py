"""Recorded VR hands, with the faults of real trackers added, through gate, clutch and limiter; the clock is the test's.

The arm is six joints whose forward kinematics is exact: three that slide, 0.3 m a radian, and a rotation vector that
wraps at the half turn. What is checked here does not depend on how a solver finds joints.
"""

from dataclasses import dataclass, field

import numpy as np
import pytest

from ik_client.engagement import ArmEngagement, ArmStep
from ik_client.gate import Gated, PoseGate, Verdict
from ik_client.hand import HandSample
from ik_client.joint_limiter import JointLimiter, MotionLimits
from ik_client.rotation import rotation_matrix, rotation_vector
from ik_client.state_machine import ArmState
from ik_proto.pose import as_pose

pytest.importorskip("ruckig")

RECORDINGS = ["dev-recording", "tracked-recording", "grabLeft"]
TICK = 0.01
SLIDE = 0.3
N = 6
HOLD = np.full(N, np.nan)
LIMITS = MotionLimits()
PELVIS_XR = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Axes of WebXR (x right, y up, z back) in those of the pelvis frame (x forward, y left, z up)."""
STOP = int((LIMITS.velocity / LIMITS.acceleration + 2 * LIMITS.acceleration / LIMITS.jerk) / TICK) + 2
"""Ticks within which any motion can be braked to rest."""


def solve(T):
    return np.concatenate([T[:3, 3] / SLIDE, rotation_vector(T[:3, :3])])


def forward(q):
    T = np.eye(4)
    T[:3, :3] = rotation_matrix(q[3:])
    T[:3, 3] = SLIDE * q[:3]
    return T


@dataclass
class Track:
    """Samples of a hand in order of arrival; None where the tracker says nothing."""

    times: list[float]
    samples: list[HandSample | None]

    def at(self, now: float) -> HandSample | None:
        """The latest that has arrived."""
        k = int(np.searchsorted(self.times, now, side="right")) - 1
        return self.samples[k] if k >= 0 else None


def recorded(folder, name, side) -> tuple[np.ndarray, np.ndarray]:
    with np.load(folder / "human" / "vr" / f"{name}.npz") as data:
        times, poses = data[f"t_{side}"], data[side].copy()
    poses[:, :3, :3] = PELVIS_XR @ poses[:, :3, :3] @ PELVIS_XR.T
    poses[:, :3, 3] = poses[:, :3, 3] @ PELVIS_XR.T
    return times, poses


def grip_at(time: float) -> bool:
    """An operator who lets go for a moment and grips again every second."""
    return time % 1.0 > 0.15


def clean(times, poses) -> Track:
    return Track(times.tolist(), [HandSample(T, grip_at(t), float(t)) for t, T in zip(times, poses, strict=True)])


@dataclass(frozen=True)
class Loss:
    """When a hand was truly lost [s], and how long it may take to notice [s]."""

    begin: float
    end: float
    notice: float


NOTICE = {"drop": 0.1, "untracked": 0.0, "nan": 0.0, "silent": 0.0}


def faulty(times, poses, seed) -> tuple[Track, list[Loss]]:
    """The recording with a fault about every half second, and when the hand was lost by them.

    Drop-outs of 128 ms and longer, glitches of one sample, jumps that stay, bursts without tracking or sense, freezes
    with a drifting gyroscope.
    """
    rng = np.random.default_rng(seed)
    samples: list[HandSample | None] = list(clean(times, poses).samples)
    keep = np.ones(len(times), dtype=bool)
    offset = np.zeros(3)
    losses: list[Loss] = []
    due, k = times[0] + 0.7, 0
    while k < len(times):
        sample = samples[k]
        assert sample is not None
        if times[k] < due:
            samples[k] = moved(sample, offset)
            k += 1
            continue
        due = times[k] + rng.uniform(0.3, 0.8)
        kind = rng.choice(["drop", "glitch", "jump", "untracked", "nan", "silent", "freeze"])
        length = rng.choice([0.128, 0.128, 0.3, 0.7]) if kind in ("drop", "freeze") else rng.choice([0.05, 0.2, 0.6])
        end = k + 1 if kind == "glitch" else int(np.searchsorted(times, times[k] + length))
        if kind == "jump":
            offset = rng.uniform(-1.0, 1.0, 3)
            continue
        end = min(end, len(times) - 1)
        if kind in NOTICE:
            losses.append(Loss(times[k], times[end], NOTICE[kind]))
        for i in range(k, end):
            sample = samples[i]
            assert sample is not None
            here = moved(sample, offset)
            match kind:
                case "drop":
                    keep[i] = False
                case "glitch":
                    samples[i] = moved(here, rng.uniform(0.3, 1.0, 3))
                case "untracked":
                    samples[i] = HandSample(
                        moved(here, rng.uniform(-1, 1, 3)).pose, here.grip, here.stamp, tracked=False
                    )
                case "nan":
                    samples[i] = HandSample(np.full((4, 4), np.nan), here.grip, here.stamp)
                case "silent":
                    samples[i] = None
                case "freeze":
                    frozen = here.pose.copy()
                    frozen[:3, 3] = poses[k, :3, 3] + offset
                    samples[i] = HandSample(frozen, here.grip, here.stamp)
        k = max(end, k + 1)
    return Track(times[keep].tolist(), [s for s, kept in zip(samples, keep, strict=True) if kept]), losses


def moved(sample: HandSample, way) -> HandSample:
    T = sample.pose.copy()
    T[:3, 3] += way
    return HandSample(T, sample.grip, sample.stamp, sample.tracked)


@dataclass
class Replay:
    """What came out, tick by tick."""

    steps: list[ArmStep] = field(default_factory=list)
    commands: list[np.ndarray] = field(default_factory=list)
    resting_points: list[np.ndarray] = field(default_factory=list)

    def active(self) -> np.ndarray:
        return np.array([step.state is ArmState.ACTIVE for step in self.steps])

    def differences(self) -> tuple[float, float, float]:
        """Largest velocity, acceleration and jerk of the commands."""
        still = [self.commands[0]] * 3
        v, a, j = (np.diff([*still, *self.commands], n, axis=0) / TICK**n for n in (1, 2, 3))
        return np.abs(v).max(), np.abs(a).max(), np.abs(j).max()


class EveryStep:
    """In place of the limiter: none."""

    resting_point = np.zeros(N)

    def limit(self, q_last, q_wanted):
        q = np.where(np.isfinite(q_wanted), q_wanted, q_last)
        self.resting_point = q
        return q


class OpenGate(PoseGate):
    """In place of the gate: whatever is a pose passes."""

    def check(self, sample, now):
        try:
            return Gated(Verdict.OK, as_pose(sample.pose)) if sample else Gated(Verdict.MISSING)
        except ValueError:
            return Gated(Verdict.INVALID)


def replay(track: Track, *, gate=None, limiter=None) -> Replay:
    """Run the loop as a teleop loop would: one sample at most per tick, hold by having no goal."""
    arm = ArmEngagement(gate=gate)
    limiter = limiter or JointLimiter(N, TICK, LIMITS)
    q = np.array([0.5, 0.5, 0.5, 0.1, 0.2, 0.3])
    done = Replay()
    for k in range(int((track.times[-1] + 1.0) / TICK)):
        now = 100.0 + k * TICK
        step = arm.step(track.at(k * TICK), now, wrist=lambda: forward(limiter.resting_point), aligned=True)
        q = limiter.limit(q, HOLD if step.target is None else solve(step.target))
        done.steps.append(step)
        done.commands.append(q)
        done.resting_points.append(limiter.resting_point)
    return done


def assert_safe(done: Replay) -> None:
    velocity, acceleration, jerk = done.differences()
    assert velocity <= LIMITS.velocity * (1 + 1e-9)
    assert acceleration <= LIMITS.acceleration * (1 + 1e-9)
    assert jerk <= LIMITS.jerk * (1 + 1e-6)
    holding = 0
    for k, active in enumerate(done.active()):
        holding = 0 if active else holding + 1
        if holding > 1:
            # It is decided in the first tick of a hold where the arm stops.
            np.testing.assert_allclose(done.resting_points[k], done.resting_points[k - 1], rtol=0, atol=1e-8)
        if holding > STOP + 1:
            np.testing.assert_allclose(done.commands[k], done.commands[k - 1], rtol=0, atol=1e-12)


def assert_still_while_lost(done: Replay, losses: list[Loss]) -> int:
    """By when the hand was truly lost, not by what the arm made of it. Gives the number of ticks without motion."""
    still = 0
    for loss in losses:
        first = int(np.ceil((loss.begin + loss.notice) / TICK)) + 1
        last = int(np.floor(loss.end / TICK))
        assert all(step.target is None for step in done.steps[first : last + 1])
        resting = np.array(done.commands[first + STOP : last + 1])
        assert len(resting) == 0 or np.ptp(resting, axis=0).max() <= 1e-12
        still += len(resting)
    return still


def longest_leap(done: Replay) -> float:
    """Longest step of the wrist's target between two ticks in which the arm was active [m]."""
    pairs = zip(done.steps, done.steps[1:], strict=False)
    steps = [(a.target, b.target) for a, b in pairs if a.target is not None and b.target is not None]
    return max(float(np.linalg.norm(b[:3, 3] - a[:3, 3])) for a, b in steps)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("name", RECORDINGS)
def test_a_recorded_hand_is_followed_within_all_bounds(shared_data, name, side):
    done = replay(clean(*recorded(shared_data, name, side)))
    assert_safe(done)
    assert done.active().mean() > 0.6
    assert np.ptp(np.array(done.commands)[:, :3], axis=0).max() > 0.1 / SLIDE


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("name", RECORDINGS)
def test_a_hand_with_drop_outs_and_jumps_moves_the_arm_within_all_bounds_and_not_while_lost(shared_data, name, side):
    """Hazard rows "stale target", "teleporting target", "first frame / re-clutch", "velocity / acceleration / jerk"."""
    verdicts, still = set(), 0
    for seed in range(3):
        times, poses = recorded(shared_data, name, side)
        track, losses = faulty(times, poses, seed)
        done = replay(track)
        assert_safe(done)
        still += assert_still_while_lost(done, losses)
        assert done.active().mean() > 0.2
        # What a hand at 3 m/s does between two samples of this recording.
        assert longest_leap(done) <= 3.0 * (np.diff(times).max() + TICK)
        verdicts |= {step.verdict for step in done.steps}
    assert set(Verdict) <= verdicts
    assert still > 50


def test_a_controller_out_of_sight_is_lost_though_it_turns(shared_data):
    """In this recording the position stays the same to the bit for 0.83 s, while the rotation drifts."""
    times, poses = recorded(shared_data, "tracked-recording", "right")
    same = (np.diff(poses[:, :3, 3], axis=0) == 0.0).all(axis=1)
    assert same.sum() > 70
    done = replay(clean(times, poses))
    assert Verdict.FROZEN in {step.verdict for step in done.steps}


def test_without_the_limiter_the_bounds_would_break(shared_data):
    """Negative control."""
    track, _ = faulty(*recorded(shared_data, "grabLeft", "left"), 0)
    with pytest.raises(AssertionError):
        assert_safe(replay(track, limiter=EveryStep()))


def test_without_the_gate_the_target_would_leap(shared_data):
    """Negative control: a limiter alone turns jumps into legal motion towards bogus targets."""
    track, _ = faulty(*recorded(shared_data, "grabLeft", "left"), 0)
    done = replay(track, gate=OpenGate())
    velocity, acceleration, _ = done.differences()
    assert velocity <= LIMITS.velocity * (1 + 1e-9)
    assert acceleration <= LIMITS.acceleration * (1 + 1e-9)
    assert longest_leap(done) > 0.5
