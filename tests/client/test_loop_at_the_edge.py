"""The loop with a real service where bodies end: out of reach, a straight elbow, caught arms, arms that would meet.

The clock advances by a tick a tick, so that a slow machine changes nothing.
"""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from ik_client import (
    ArmEngagement,
    ArmState,
    Command,
    GateLimits,
    Hands,
    HandSample,
    IKClient,
    LoopState,
    PoseGate,
    RobotState,
    Seed,
    TeleopLoop,
    TickReport,
)
from ik_client.clear_way import KEPT
from ik_client.joint_limiter import JointLimiter, MotionLimits
from ik_client.ways_out import AHEAD
from ik_proto import MAX_POSTURES, Array, SolveReply, Status

TICK = 0.02
LIMITS = MotionLimits()
Path = Callable[[float], tuple[Array, Array]]


class Arms:
    """Follow every command exactly."""

    def __init__(self, q: Array) -> None:
        self.q = q
        self.commands: list[Command] = []

    def read(self) -> RobotState:
        return RobotState(self.q, np.zeros(len(self.q)), 0.0)

    def send(self, command: Command) -> None:
        self.commands.append(command)
        self.q = command.q


class Operator:
    """Two hands on a path; they grip after the first look."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.begin: float | None = None

    def hands(self, now: float) -> Hands:
        grip = self.begin is not None
        self.begin = now if self.begin is None else self.begin
        left, right = self.path(now - self.begin)
        return Hands(HandSample(left, grip, now), HandSample(right, grip, now))


def absolute() -> ArmEngagement:
    gate = PoseGate(GateLimits(freeze_time=float("inf")))
    return ArmEngagement.absolute(gate)


class Run:
    """A loop on a path, from the posture of all joints at zero, or another one."""

    def __init__(self, ik: IKClient, path: Path, q: Array | None = None) -> None:
        info = ik.info()
        self.ik, self.now = ik, 0.0
        self.arms = Arms(np.clip(np.zeros(len(info.joint_names)) if q is None else q, info.lower, info.upper))
        limiter = JointLimiter(len(self.arms.q), TICK, lower=info.lower, upper=info.upper)
        self.loop = TeleopLoop(
            ik, Operator(path), self.arms, limiter, arms=(absolute(), absolute()), clock=lambda: self.now
        )

    def ticks(self, seconds: float) -> list[TickReport]:
        reports = []
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            reports.append(self.loop.tick())
        return reports

    def assert_bounded(self) -> None:
        q = np.array([command.q for command in self.arms.commands])
        assert np.abs(np.diff(q, axis=0)).max() <= LIMITS.velocity * TICK * 1.000001
        assert np.abs(np.diff(q, 2, axis=0)).max() <= LIMITS.acceleration * TICK**2 * 1.000001
        assert np.abs(np.diff(q, 3, axis=0)).max() <= LIMITS.jerk * TICK**3 * 1.000001


@pytest.fixture
def ik(service_process) -> Iterator[IKClient]:
    with IKClient(service_process.tcp_url, timeout=5.0) as ik:
        yield ik


def home(ik: IKClient) -> tuple[Array, Array]:
    wrists = ik.fk(np.zeros(len(ik.info().joint_names)))
    return wrists.left_wrist, wrists.right_wrist


CAUGHT = np.array([1.84, 2.2, 1.54, -0.1, -1.26, 0.03, 0.31])
"""Where a left arm ended that had been stretched out to the side, and then reached forward [rad]."""
FORWARD = np.array([-1.2, 0.3, 0.1, 1.2, 0.0, 0.0, 0.0])
MIRRORED = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def forward(ik: IKClient) -> tuple[Array, Array]:
    """Both wrists where arms that reach forward have them."""
    wrists = ik.fk(np.concatenate([FORWARD, MIRRORED * FORWARD]))
    return wrists.left_wrist, wrists.right_wrist


@pytest.fixture
def modes(ik, monkeypatch) -> list[str | None]:
    """The modes in which the service is asked to solve."""
    asked, solve = [], ik.solve

    def noted(*args, **options) -> SolveReply:
        asked.append(options.get("mode"))
        return solve(*args, **options)

    monkeypatch.setattr(ik, "solve", noted)
    return asked


def shifted(T: Array, way: Array) -> Array:
    T = T.copy()
    T[:3, 3] += way
    return T


def there_and_back(time: float, seconds: float) -> float:
    """From 0 to 1 and back to 0, smoothly."""
    return 0.5 * (1.0 - np.cos(2.0 * np.pi * min(time, seconds) / seconds))


PLACES = {
    "at twice the reach": (np.array([1.0, 0.3, 0.2]), Status.UNREACHABLE),
    "behind the back": (np.array([-0.8, 0.1, 0.0]), Status.UNREACHABLE),
    "inside the torso": (np.array([-0.25, -0.15, 0.05]), Status.BLOCKED),
}


@pytest.mark.parametrize("place", PLACES)
def test_out_of_reach_the_loop_goes_on_says_so_and_comes_back(ik, place):
    """Hazard: unreachable. The nearest pose, the distance that is left, and no less control than before."""
    way, status = PLACES[place]
    left, right = home(ik)
    mirrored = way * [1.0, -1.0, 1.0]

    def path(time: float) -> tuple[Array, Array]:
        far = there_and_back(time - 1.0, 5.0) if time > 1.0 else 0.0
        return shifted(left, far * way), shifted(right, far * mirrored)

    run = Run(ik, path)
    reports = run.ticks(8.5)
    assert all(report.state is LoopState.TRACKING for report in reports[3:])
    assert run.loop.states == (ArmState.ACTIVE,) * 2
    farthest = reports[round(3.5 / TICK)]
    assert farthest.status is status
    assert farthest.position_error is not None
    assert farthest.position_error.min() > 0.02
    run.assert_bounded()
    last = ik.fk(run.arms.q)
    assert np.linalg.norm(last.left_wrist[:3, 3] - left[:3, 3]) < 0.002
    assert np.linalg.norm(last.right_wrist[:3, 3] - right[:3, 3]) < 0.002


def test_through_a_straight_elbow_and_out_again(ik):
    """Hazard: singularity. Stretched to 1.15 of its reach, at bounded speed either way, and leaving is not blocked."""
    info = ik.info()
    left, right = home(ik)
    outward = [np.array([0.6, side, 0.1]) / np.linalg.norm([0.6, side, 0.1]) for side in (0.5, -0.5)]

    def path(time: float) -> tuple[Array, Array]:
        far = there_and_back(time - 1.0, 4.0) if time > 1.0 else 0.0
        poses = []
        for T, shoulder, reach, direction in zip((left, right), info.shoulders, info.reach, outward, strict=True):
            poses.append(shifted(T, far * (shoulder + 1.15 * reach * direction - T[:3, 3])))
        return poses[0], poses[1]

    run = Run(ik, path)
    reports = run.ticks(8.5)
    elbows = [name.endswith("elbow_joint") for name in info.joint_names]
    assert sum(elbows) == 2
    q = np.array([command.q for command in run.arms.commands])
    straight = q[:, elbows].max(axis=0)
    bent = q[0, elbows]
    assert (straight - bent > 1.0).all()  # from the right angle of q = 0 to nearly straight
    assert any(report.status is Status.UNREACHABLE for report in reports)
    run.assert_bounded()
    # On the way back, as soon as the hands are within reach again, they are followed.
    back = reports[round(4.0 / TICK) : round(4.5 / TICK)]
    assert all(report.status is Status.OK and report.state is LoopState.TRACKING for report in back)
    last = ik.fk(run.arms.q)
    assert np.linalg.norm(last.left_wrist[:3, 3] - left[:3, 3]) < 0.002


def test_arms_that_are_led_through_each_other_stay_apart(ik):
    """Hazard: self-collision, behind the limiter: what is measured is the commands, not the answers.

    Without the check of the way the hands passed 43 mm through each other here, although every answer was clear.
    """
    left, right = home(ik)

    def path(time: float) -> tuple[Array, Array]:
        far = there_and_back(time - 1.0, 4.0) if time > 1.0 else 0.0
        return shifted(left, far * np.array([0.05, -0.32, 0.1])), shifted(right, far * np.array([0.05, 0.32, 0.1]))

    run = Run(ik, path)
    reports = run.ticks(8.0)
    assert any(report.status is Status.BLOCKED for report in reports)
    run.assert_bounded()
    assert smallest_clearance(ik, run) >= KEPT - 1e-6
    last = ik.fk(run.arms.q)
    assert np.linalg.norm(last.left_wrist[:3, 3] - left[:3, 3]) < 0.002


def test_without_the_check_of_the_way_they_would_meet(ik):
    """The negative control."""
    left, right = home(ik)

    def path(time: float) -> tuple[Array, Array]:
        far = there_and_back(time - 1.0, 4.0) if time > 1.0 else 0.0
        return shifted(left, far * np.array([0.05, -0.32, 0.1])), shifted(right, far * np.array([0.05, 0.32, 0.1]))

    run = Run(ik, path)
    run.loop._way = None
    run.ticks(3.5)
    assert smallest_clearance(ik, run) < 0.0


def smallest_clearance(ik: IKClient, run: Run) -> float:
    """The nearest that any command came to the body [m]."""
    q = np.array([command.q for command in run.arms.commands])
    parts = [ik.clearance(part).clearance for part in np.array_split(q, 1 + len(q) // MAX_POSTURES)]
    return min(float(part.min()) for part in parts if part is not None)


def test_a_solver_alone_leaves_a_caught_arm_where_it_is(ik):
    left, right = forward(ik)
    q = np.concatenate([CAUGHT, MIRRORED * FORWARD])
    for _ in range(300):
        reply = ik.solve(left, right, q, np.zeros(len(q)))
        q = reply.sol_q
    assert reply.status is Status.UNREACHABLE
    assert reply.position_error[0] > 0.1


def test_a_caught_arm_is_led_out_slowly_and_then_follows(ik, modes):
    """Hazard: caught arm. It moves slowly, as nobody expects it to."""
    targets = forward(ik)
    run = Run(ik, lambda t: targets, np.concatenate([CAUGHT, MIRRORED * FORWARD]))
    reports = run.ticks(7.0)
    run.assert_bounded()
    found = [report for report in reports if report.seed is Seed.FOUND]
    assert 0 < len(found) < 4.0 / TICK
    assert modes.count("reach") == 1
    assert all(report.state is LoopState.TRACKING for report in reports[reports.index(found[0]) :])
    # Slowly, and clear of the body; in the last of these ticks it has arrived.
    q = np.array([report.command.q for report in found])
    assert np.abs(np.diff(q[:-1, :7], axis=0)).max() <= AHEAD * 1.000001
    assert ik.clearance(q[:MAX_POSTURES]).clearance.min() > KEPT - 1e-9
    # It is there, and tracks from where it is again; the other arm was at rest all the time.
    last = reports[-1]
    assert last.seed is Seed.COMMAND
    assert last.status is Status.OK
    wrists = ik.fk(last.command.q)
    assert np.linalg.norm(wrists.left_wrist[:3, 3] - targets[0][:3, 3]) < 1e-3
    assert np.abs(q[:, 7:] - MIRRORED * FORWARD).max() < 0.01


def test_an_arm_on_its_way_out_follows_a_hand_that_moves_on(ik):
    left, right = forward(ik)

    def path(t: float) -> tuple[Array, Array]:
        return shifted(left, np.array([0.0, 0.03 * np.sin(t), 0.0])), right

    run = Run(ik, path, np.concatenate([CAUGHT, MIRRORED * FORWARD]))
    reports = run.ticks(8.0)
    run.assert_bounded()
    assert any(report.seed is Seed.FOUND for report in reports)
    wrists = ik.fk(reports[-1].command.q)
    assert np.linalg.norm(wrists.left_wrist[:3, 3] - path(8.0)[0][:3, 3]) < 0.01


def test_what_is_out_of_reach_is_searched_for_once_in_a_while_and_moves_nothing(ik, modes):
    """Hazard: caught arm. One whose target is out of reach is not caught."""
    left, right = forward(ik)
    run = Run(ik, lambda t: (shifted(left, np.array([0.4, 0.0, 0.0])), right))
    reports = run.ticks(6.0)
    assert reports[-1].status is Status.UNREACHABLE
    assert 2 <= modes.count("reach") <= 6
    assert all(report.seed is Seed.COMMAND for report in reports[5:])
    assert np.abs(reports[-1].command.q - reports[-50].command.q).max() < 0.05


def test_a_hand_that_lets_go_stops_the_way_out(ik):
    """Hazard: caught arm. The operator ends its motion like every other one."""
    left, right = forward(ik)
    run = Run(ik, lambda t: (left, right), np.concatenate([CAUGHT, MIRRORED * FORWARD]))
    while run.ticks(TICK)[0].seed is not Seed.FOUND:
        assert run.now < 5.0
    run.ticks(0.3)
    run.loop.stop()
    rest = run.ticks(1.0)
    assert all(report.state is LoopState.HOLDING for report in rest)
    assert np.array_equal(rest[-1].command.q, rest[-10].command.q)
    assert np.abs(rest[-1].command.q[:7] - CAUGHT).max() > 0.05
