"""The teleop loop's rules, with a clock, a robot, a tracker and a service that do what the test says."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ik_client import (
    ArmState,
    BadRequest,
    Command,
    Hands,
    HandSample,
    LoopState,
    ProtocolMismatch,
    Refused,
    RobotState,
    Seed,
    ServiceTimeout,
    ServiceUnavailable,
    TeleopLoop,
    TickReport,
    WeightedMovingFilter,
)
from ik_client.ending import LONGEST, come_to_rest
from ik_client.joint_limiter import JointLimiter, MotionLimits
from ik_client.pacer import Pacer
from ik_client.resting_torque import RATE
from ik_proto import ClearanceReply, FkReply, SolveReply, Status

pytest.importorskip("ruckig")

N = 14
TICK = 0.02
LIMITS = MotionLimits()
EYE = np.eye(4)
LEFT, RIGHT = slice(0, 7), slice(7, 14)
SLACK = 1.0 + 1e-6


def answer(q, *, tau=None, status=Status.OK, boot_id="a") -> SolveReply:
    return SolveReply(
        success=status.success,
        error="" if status.success else "stopped",
        status=status,
        boot_id=boot_id,
        sol_q=q,
        tau=np.zeros(N) if tau is None else tau,
        position_error=np.array([0.001, 0.002]),
        rotation_error=np.array([0.01, 0.02]),
        solve_us=8.0,
    )


class Robot:
    """Measures what it is told to, and remembers its commands."""

    def __init__(self, q=None) -> None:
        self.q: np.ndarray | None = q
        self.dq = np.zeros(N)
        self.says: dict = {}
        self.commands: list[Command] = []
        self.fault: Exception | None = None

    def read(self) -> RobotState:
        if self.fault:
            raise self.fault
        # Unless told otherwise it is where it was sent to.
        q = self.q if self.q is not None else self.commands[-1].q.copy() if self.commands else np.zeros(N)
        return RobotState(q, self.dq, 0.0, **self.says)

    def send(self, command: Command) -> None:
        self.commands.append(command)


class Tracker:
    """Two hands that move a little in every tick, as hands do."""

    def __init__(self) -> None:
        self.grip = [False, False]
        self.adds: dict = {}
        self.says: Callable[[float], Hands | None] = self.look

    def look(self, now: float) -> Hands:
        pose = EYE.copy()
        pose[0, 3] = 0.01 * now
        left, right = (HandSample(pose.copy(), grip, now) for grip in self.grip)
        return Hands(left, right, **self.adds)

    def hands(self, now: float) -> Hands | None:
        return self.says(now)


class Service:
    """Solves by a rule; an exception for an answer is raised."""

    def __init__(self) -> None:
        self.says: Callable[[np.ndarray], SolveReply | Exception] = lambda q: answer(np.ones(N))
        self.knows: Callable[[np.ndarray], FkReply | Exception] = lambda q: self.wrists()
        self.measures: Callable[[np.ndarray], ClearanceReply | Exception] = lambda q: self.clear(q, 1.0)
        self.measured = 0
        self.boot_id = "a"
        self.asked: list[tuple[np.ndarray, ...]] = []
        self.options: list[dict] = []

    def clear(self, q, distance) -> ClearanceReply:
        return ClearanceReply(
            success=True,
            error="",
            status=Status.OK,
            boot_id=self.boot_id,
            clearance=np.full(len(q), distance),
            nearest=("left_hand", "torso"),
        )

    def wrists(self) -> FkReply:
        left, right = EYE.copy(), EYE.copy()
        left[1, 3], right[1, 3] = 0.2, -0.2
        return FkReply(
            success=True, error="", status=Status.OK, boot_id=self.boot_id, left_wrist=left, right_wrist=right
        )

    def solve(self, left_wrist, right_wrist, q, dq, **options) -> SolveReply:
        self.options.append(options)
        self.asked.append((left_wrist, right_wrist, q, dq))
        return _told(self.says(q))

    def fk(self, q, waist=None) -> FkReply:
        return _told(self.knows(q))

    def clearance(self, q, waist=None) -> ClearanceReply:
        self.measured += len(q)
        return _told(self.measures(q))


def _told(said):
    if isinstance(said, Exception):
        raise said
    return said


class Bench:
    """A loop and everything around it."""

    def __init__(self, q=None, **options) -> None:
        self.robot, self.tracker, self.service = Robot(q), Tracker(), Service()
        self.now = 0.0
        self.loop = TeleopLoop(
            self.service, self.tracker, self.robot, JointLimiter(N, TICK), clock=lambda: self.now, **options
        )

    def tick(self) -> TickReport:
        self.now += TICK
        return self.loop.tick()

    def ticks(self, count: int) -> list[TickReport]:
        return [self.tick() for _ in range(count)]

    def engage(self, left=True, right=True) -> TickReport:
        """Let go, grip, and be followed."""
        self.tracker.grip = [False, False]
        self.tick()
        self.tracker.grip = [left, right]
        self.ticks(2)
        wanted = tuple(ArmState.ACTIVE if arm else ArmState.DISARMED for arm in (left, right))
        assert self.loop.states == wanted
        return self.tick()

    def stand_before_a_wall(self) -> None:
        """From now on the first joint meets the body at 0.4 rad."""

        def wall(q):
            reply = self.service.clear(q, 0.0)
            reply.clearance = 0.4 - q[:, 0]
            return reply

        self.service.measures = wall

    def assert_bounded(self) -> None:
        assert_bounded(self.robot.commands)


def assert_bounded(commands: list[Command]) -> None:
    """Finite differences of the commands keep the bounds: means over ticks of what the limiter bounds everywhere."""
    q = np.array([commands[0].q] * 3 + [command.q for command in commands])
    assert np.isfinite(q).all()
    assert np.abs(np.diff(q, axis=0)).max(initial=0.0) <= LIMITS.velocity * TICK * SLACK
    assert np.abs(np.diff(q, 2, axis=0)).max(initial=0.0) <= LIMITS.acceleration * TICK**2 * SLACK
    assert np.abs(np.diff(q, 3, axis=0)).max(initial=0.0) <= LIMITS.jerk * TICK**3 * SLACK


def at_rest(commands: list[Command]) -> bool:
    return bool(np.abs(commands[-1].q - commands[-2].q).max() <= 1e-9)


def test_nothing_moves_and_nothing_is_asked_before_a_grip():
    q = np.linspace(-1, 1, N)
    bench = Bench(q.copy())
    for sag in range(5):
        bench.robot.q = q - 0.01 * sag
        report = bench.tick()
        assert report.state is LoopState.HOLDING
        assert report.reason == "not engaged: grip to engage"
        assert not report.command.engaged
        np.testing.assert_array_equal(report.command.q, q)
        np.testing.assert_array_equal(report.command.tau, np.zeros(N))
    assert not bench.service.asked


def test_gripped_it_goes_to_the_answer_within_all_bounds():
    bench = Bench()
    bench.engage()
    reports = bench.ticks(60)
    assert all(report.state is LoopState.TRACKING and not report.reason for report in reports)
    assert all(report.command.engaged for report in reports)
    np.testing.assert_allclose(bench.robot.commands[-1].q, np.ones(N), rtol=0, atol=1e-9)
    bench.assert_bounded()


def test_held_at_start_does_not_arm():
    """Hazard: deadman release. A grip that is held when the loop begins must be let go first."""
    bench = Bench()
    bench.tracker.grip = [True, True]
    assert all(report.state is LoopState.HOLDING for report in bench.ticks(100))
    assert np.ptp([command.q for command in bench.robot.commands], axis=0).max() == 0.0


def test_letting_go_brakes_from_that_very_tick_on():
    """Hazard: deadman release."""
    bench = Bench()
    bench.engage()
    bench.ticks(5)
    moving = np.abs(bench.robot.commands[-1].q - bench.robot.commands[-2].q).max()
    asked = len(bench.service.asked)
    bench.tracker.grip = [False, False]
    report = bench.tick()
    assert report.state is LoopState.HOLDING
    assert report.reason == "the grip was released"
    assert moving > 0.01
    # The way on is no longer than what it takes to stop: v^2 / 2a, and the jerk's share v a / 2j.
    stop = LIMITS.velocity**2 / (2 * LIMITS.acceleration) + LIMITS.velocity * LIMITS.acceleration / (2 * LIMITS.jerk)
    before = bench.robot.commands[-1].q
    bench.ticks(30)
    assert np.abs(bench.robot.commands[-1].q - before).max() <= stop
    assert at_rest(bench.robot.commands)
    assert len(bench.service.asked) == asked
    bench.assert_bounded()


def test_one_hand_moves_one_arm():
    bench = Bench(feed_forward=True)

    def says(q):
        if bench.service.options[-1]["collision"] == "off":  # the torque of where an arm rests
            return answer(q, tau=np.full(N, 1.0))
        return answer(np.concatenate([np.ones(7), q[7:]]), tau=np.full(N, 3.0))

    bench.service.says = says
    report = bench.engage(right=False)
    left, right = report.targets
    assert left is not None
    assert right is None
    assert all((right == bench.service.wrists().right_wrist).all() for _, right, _, _ in bench.service.asked)
    bench.ticks(60)
    last = bench.robot.commands[-1]
    np.testing.assert_allclose(last.q[LEFT], 1.0, atol=1e-9)
    np.testing.assert_array_equal(last.q[RIGHT], np.zeros(7))
    np.testing.assert_array_equal(last.tau[LEFT], np.full(7, 3.0))
    np.testing.assert_array_equal(last.tau[RIGHT], np.full(7, 1.0))


def test_an_answer_that_needs_the_held_arm_elsewhere_is_not_followed():
    """Hazard: self-collision. What keeps the arms apart in the answer would not happen."""
    bench = Bench()
    bench.engage(right=False)
    report = bench.tick()  # the answer moves both arms to one
    assert report.state is LoopState.HOLDING
    assert report.reason == "the right arm, which holds, is in the way"
    bench.ticks(20)
    np.testing.assert_array_equal(bench.robot.commands[-1].q[RIGHT], np.zeros(7))
    assert at_rest(bench.robot.commands)


def test_a_step_that_could_not_be_stopped_clear_of_the_body_is_not_taken():
    """Hazard: self-collision. The answer is clear, but an arm with speed would be carried past it."""
    bench = Bench()
    bench.stand_before_a_wall()
    bench.engage()
    bench.ticks(60)
    q = np.array([command.q[0] for command in bench.robot.commands])
    assert q.max() <= 0.395
    assert q.max() > 0.3
    bench.assert_bounded()


@pytest.mark.parametrize(("collision", "asks"), [(None, True), ("avoid", True), ("report", False), ("off", False)])
def test_the_way_is_measured_where_collisions_are_avoided(collision, asks):
    bench = Bench(collision=collision)
    bench.engage()
    assert bool(bench.service.measured) is asks


def test_where_the_way_cannot_be_measured_the_arm_brakes():
    bench = Bench()
    bench.engage()
    bench.ticks(5)
    bench.service.measures = lambda q: ServiceTimeout(URL, 0.01)
    report = bench.tick()
    assert report.state is LoopState.HOLDING
    assert "no answer within" in report.reason
    bench.ticks(40)
    assert at_rest(bench.robot.commands)
    bench.assert_bounded()


def test_a_robot_without_capsules_is_not_slowed():
    bench = Bench()
    bench.service.measures = lambda q: replace(bench.service.clear(q, 0.0), clearance=None, nearest=None)
    bench.engage()
    bench.ticks(60)
    np.testing.assert_allclose(bench.robot.commands[-1].q, np.ones(N), atol=1e-9)


def test_a_report_tells_what_happened():
    bench = Bench()
    bench.engage()

    def slow(q):
        bench.now += 0.003
        return answer(np.ones(N))

    bench.service.says = slow
    begin = bench.now + TICK
    report = bench.tick()
    assert report.time == pytest.approx(begin)
    assert report.round_trip == pytest.approx(0.003)
    assert (report.status, report.solve_us, report.boot_id, report.seed) == (Status.OK, 8.0, "a", Seed.COMMAND)
    assert report.position_error is not None
    np.testing.assert_array_equal(report.position_error, [0.001, 0.002])
    assert report.command is bench.robot.commands[-1]
    assert all(target is not None for target in report.targets)
    assert [step.state for step in report.arms] == [ArmState.ACTIVE] * 2
    assert report.measured is not None


def test_commands_are_numbered_and_tell_where_they_come_from():
    bench = Bench()
    bench.engage()
    commands = bench.robot.commands
    assert [command.seq for command in commands] == list(range(1, len(commands) + 1))
    assert {command.session for command in commands} == {bench.loop.session}
    assert Bench().loop.session != bench.loop.session
    assert commands[-1].boot_id == "a"


def test_the_measured_waist_and_what_the_tracker_adds_go_with_the_solve():
    bench = Bench(collision="report")
    waist, elbow, weights = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.0, -1.0, 0.5]), np.ones((2, 2))
    bench.engage()
    nothing = {"waist": None, "left_elbow": None, "right_elbow": None, "weights": None}
    assert bench.service.options[-1] == {**nothing, "collision": "report"}
    bench.robot.says = {"waist": waist}
    bench.tracker.adds = {"left_elbow": elbow, "right_elbow": -elbow, "weights": weights}
    assert bench.tick().state is LoopState.TRACKING
    options = bench.service.options[-1]
    assert options["waist"] is waist
    assert options["left_elbow"] is elbow
    np.testing.assert_array_equal(options["right_elbow"], -elbow)
    assert options["weights"] is weights


def test_the_report_tells_the_clearance():
    bench = Bench()
    assert bench.engage().clearance is None
    bench.service.says = lambda q: replace(answer(np.ones(N), status=Status.BLOCKED), clearance=0.012)
    report = bench.tick()
    assert (report.state, report.status, report.clearance) == (LoopState.TRACKING, Status.BLOCKED, 0.012)


def test_it_begins_where_the_robots_end_holds_the_joints():
    """Hazard: first frame / re-clutch. A sagging arm is not pulled down to where it hangs."""
    q_set = np.linspace(-1, 1, N)
    bench = Bench(q_set - 0.05)
    bench.robot.says = {"q_set": q_set, "tau_set": np.full(N, 2.0), "following": False}
    command = bench.tick().command
    np.testing.assert_array_equal(command.q, q_set)
    np.testing.assert_array_equal(command.tau, np.full(N, 2.0))


def test_unless_engaged_it_goes_along_with_the_robots_end():
    """Hazard: first frame / re-clutch. Command and set-point agree again before the next grip."""
    bench = Bench()
    bench.tick()
    moved = np.full(N, 0.3)
    bench.robot.q = moved
    bench.robot.says = {"q_set": moved, "following": False}
    bench.ticks(30)
    np.testing.assert_allclose(bench.robot.commands[-1].q, moved, atol=1e-9)
    bench.assert_bounded()


def test_an_arm_that_is_not_where_it_is_commanded_is_not_engaged():
    """Hazard: first frame / re-clutch."""
    bench = Bench()
    bench.tick()
    bench.robot.q = np.where(np.arange(N) == 2, 0.2, 0.0)
    bench.tracker.grip = [True, True]
    bench.ticks(5)
    assert bench.loop.states == (ArmState.ALIGNING, ArmState.ACTIVE)


def test_a_robot_that_is_not_ready_is_not_engaged():
    bench = Bench()
    bench.robot.says = {"ready": False, "note": "taking the arms"}
    bench.tick()
    bench.tracker.grip = [True, True]
    reports = bench.ticks(5)
    assert bench.loop.states == (ArmState.DISARMED,) * 2
    assert not reports[-1].command.engaged
    bench.robot.says = {}
    bench.engage()


def test_a_robot_that_lets_go_disarms():
    """Hazard: service restart (robot side), two operators: the robot's end has the last word."""
    bench = Bench()
    bench.engage()
    bench.robot.says = {"following": False, "note": "held by another session"}
    reports = bench.ticks(30)
    assert bench.loop.states == (ArmState.DISARMED,) * 2
    assert reports[-1].reason == "the robot does not follow: held by another session"
    assert at_rest(bench.robot.commands)
    # A state on its way is older than the command it does not know of yet: a moment is granted.
    assert sum(report.state is LoopState.TRACKING for report in reports) >= 9


def test_a_robot_that_reuses_its_buffer_does_not_move_the_held_command():
    bench = Bench(np.full(N, 0.5))
    bench.tick()
    assert bench.robot.q is not None
    bench.robot.q[:] = -1.0
    np.testing.assert_array_equal(bench.tick().command.q, np.full(N, 0.5))


def test_commands_are_read_only():
    bench = Bench(feed_forward=True)
    command = bench.engage().command
    for array in (command.q, command.tau):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 9.0


URL = "tcp://127.0.0.1:1"
FAULTS = {
    "unavailable": (ServiceUnavailable(URL, "nobody is there"), "ServiceUnavailable: tcp"),
    "timeout": (ServiceTimeout(URL, 0.01), "no answer within 0.01 s"),
    "mismatch": (ProtocolMismatch(URL, "junk"), "ProtocolMismatch"),
    "overloaded": (Refused(Status.OVERLOADED, "full"), "overloaded: full"),
    "bad request": (BadRequest(Status.BAD_REQUEST, "q"), "bad_request: q"),
    "a bug": (ZeroDivisionError("two\nlines"), "ZeroDivisionError: two lines"),
    "not converged": (answer(np.zeros(N), status=Status.NOT_CONVERGED), "not_converged: stopped"),
    "no joints": (answer(None), "the answer must be 14 finite numbers"),
    "13 joints": (answer(np.ones(13)), "the answer must be 14 finite numbers"),
    "not a number": (answer(np.full(N, np.nan)), "the answer must be 14 finite numbers"),
    "no torque": (answer(np.ones(N), tau=np.full(N, np.inf)), "the answer's torque must be 14 finite numbers"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_any_fault_of_the_service_brakes_in_that_tick_and_a_short_one_is_got_over(name):
    """Hazards: solver failure, lost connection, NaN / Inf (in an answer)."""
    said, reason = FAULTS[name]
    bench = Bench(feed_forward=True)
    bench.service.says = lambda q: answer(np.ones(N), tau=np.full(N, 3.0))
    bench.engage()
    before = bench.ticks(5)[-1].command
    bench.service.says = lambda q: said
    steps = []
    for _ in range(4):
        last = bench.robot.commands[-1]
        report = bench.tick()
        steps.append(np.abs(report.command.q - last.q).max())
        assert report.state is LoopState.HOLDING
        assert reason in report.reason
        assert "\n" not in report.reason
        assert (report.fault is said) is isinstance(said, Exception)
        assert report.command.tau.tobytes() == before.tau.tobytes()
    assert steps == sorted(steps, reverse=True)
    assert bench.loop.states == (ArmState.ACTIVE,) * 2
    bench.service.says = lambda q: answer(-np.ones(N))
    assert bench.tick().state is LoopState.TRACKING
    bench.ticks(80)
    np.testing.assert_allclose(bench.robot.commands[-1].q, -np.ones(N), atol=1e-9)
    bench.assert_bounded()


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_that_lasts_disarms_and_only_a_new_grip_goes_on(name):
    """Hazards: service crash, solver failure (many in a row), deadman release."""
    said, _ = FAULTS[name]
    silent = name in ("unavailable", "timeout")
    bench = Bench(feed_forward=True)
    bench.engage()
    bench.ticks(5)
    bench.service.says = lambda q: said
    if silent:
        bench.service.knows = lambda q: ServiceTimeout(URL, 0.01)
    seen = [report.arms[0].state for report in bench.ticks(60)]
    assert list(dict.fromkeys(seen)) == [ArmState.ACTIVE, ArmState.HOLD, ArmState.DISARMED]
    assert seen.index(ArmState.HOLD) * TICK <= 0.2
    assert seen.index(ArmState.DISARMED) * TICK <= 0.7
    assert at_rest(bench.robot.commands)
    held = bench.robot.commands[-1]
    bench.service.says = lambda q: answer(-np.ones(N))
    bench.service.knows = lambda q: bench.service.wrists()
    assert all(report.state is LoopState.HOLDING for report in bench.ticks(50))
    np.testing.assert_array_equal(bench.robot.commands[-1].q, held.q)
    bench.engage()
    bench.ticks(80)
    np.testing.assert_allclose(bench.robot.commands[-1].q, -np.ones(N), atol=1e-9)
    bench.assert_bounded()


def test_a_service_that_was_silent_for_a_moment_is_followed_again_under_the_same_grip():
    """Hazard: lost connection."""
    bench = Bench()
    bench.engage()
    said = ServiceTimeout(URL, 0.01)
    bench.service.says = bench.service.knows = lambda q: said
    reports = bench.ticks(15)
    assert reports[-1].arms[0].state is ArmState.HOLD
    bench.service.says, bench.service.knows = (lambda q: answer(np.ones(N))), lambda q: bench.service.wrists()
    bench.ticks(2)
    assert bench.tick().state is LoopState.TRACKING
    bench.assert_bounded()


def test_another_run_of_the_service_moves_nothing_before_a_new_grip():
    """Hazard: service restart."""
    bench = Bench()
    bench.engage()
    bench.ticks(5)
    bench.service.boot_id = "b"
    bench.service.says = lambda q: answer(-np.ones(N), boot_id="b")
    report = bench.tick()
    assert report.state is LoopState.HOLDING
    assert "another run of the service" in report.reason
    reports = bench.ticks(60)
    assert bench.loop.states == (ArmState.DISARMED,) * 2
    assert all(report.state is LoopState.HOLDING and not report.command.engaged for report in reports)
    assert (bench.robot.commands[-1].q > 0.0).all()  # never on the way to what the other run said
    assert at_rest(bench.robot.commands)
    bench.engage()
    bench.ticks(80)
    np.testing.assert_allclose(bench.robot.commands[-1].q, -np.ones(N), atol=1e-9)
    assert bench.robot.commands[-1].boot_id == "b"
    bench.assert_bounded()


@pytest.mark.parametrize(
    ("says", "reason"),
    [
        (lambda now: None, "the hand is missing"),
        (lambda now: Hands(None, None), "the hand is missing"),
        (lambda now: 1 / 0, "ZeroDivisionError"),
    ],
)
def test_without_hands_it_holds_and_asks_nothing(says, reason):
    """Hazard: stale target. A tracker that says nothing is lost in that tick."""
    bench = Bench()
    bench.engage()
    bench.ticks(3)
    asked = len(bench.service.asked)
    bench.tracker.says = says
    report = bench.tick()
    assert report.state is LoopState.HOLDING
    assert reason in report.reason
    assert report.round_trip is None
    bench.ticks(40)
    assert bench.loop.states == (ArmState.DISARMED,) * 2
    assert at_rest(bench.robot.commands)
    assert len(bench.service.asked) == asked
    bench.assert_bounded()


@pytest.mark.parametrize(
    ("q", "dq", "fault"),
    [
        (np.full(N, np.nan), np.zeros(N), None),
        (np.zeros(N - 1), np.zeros(N), None),
        (np.zeros(N), np.full(N, np.inf), None),
        (np.zeros(N), np.zeros(N), OSError("bus off")),
    ],
)
def test_a_robot_that_cannot_be_read_is_told_to_brake_and_then_disarmed(q, dq, fault):
    bench = Bench()
    bench.engage()
    bench.ticks(5)
    bench.robot.q, bench.robot.dq, bench.robot.fault = q, dq, fault
    sent = len(bench.robot.commands)
    report = bench.tick()
    assert report.state is LoopState.HOLDING
    assert report.measured is None
    assert len(bench.robot.commands) == sent + 1
    bench.ticks(40)
    assert bench.loop.states == (ArmState.DISARMED,) * 2
    assert at_rest(bench.robot.commands)
    bench.assert_bounded()


def test_a_first_tick_without_measurement_has_nothing_to_hold():
    for q in (np.full(N, np.nan), np.zeros((2, 7))):
        bench = Bench(q)
        with pytest.raises(ValueError, match="nothing to hold"):
            bench.tick()
        assert not bench.robot.commands
    bench = Bench()
    bench.robot.fault = OSError("bus off")
    with pytest.raises(OSError, match="bus off"):
        bench.tick()
    bench.robot.fault = None
    bench.engage()


def test_the_seed_is_the_command_while_it_agrees_with_the_measurement():
    bench = Bench(agreement=0.3)
    bench.engage()
    bench.robot.q = sagging = bench.robot.commands[-1].q - 0.2
    assert bench.tick().seed is Seed.COMMAND
    np.testing.assert_array_equal(bench.service.asked[-1][2], bench.robot.commands[-2].q)
    pushed = sagging.copy()
    pushed[5] += 0.9
    bench.robot.q = pushed
    assert bench.tick().seed is Seed.MEASURED
    np.testing.assert_array_equal(bench.service.asked[-1][2], pushed)
    bench.assert_bounded()  # whatever it starts from, the command goes on from the last one


def test_a_sagging_arm_does_not_pull_the_command_down():
    """The seeds' fault: solving from the measured joints makes a lagging arm creep. Here the command stays."""
    bench = Bench()
    bench.service.says = lambda q: answer(q)  # nothing to do: stay where you start
    bench.engage()
    for _ in range(200):
        command = bench.tick().command
        bench.robot.q = command.q - 0.05
    np.testing.assert_allclose(command.q, np.zeros(N), atol=1e-12)


def test_feed_forward_torque_arrives_with_the_joints():
    bench = Bench(feed_forward=True)
    bench.service.says = lambda q: answer(np.full(N, 0.1), tau=np.full(N, 5.0))
    bench.engage()
    bench.ticks(30)
    q, tau = (np.array([getattr(command, name)[0] for command in bench.robot.commands]) for name in ("q", "tau"))
    assert (np.diff(tau) >= 0.0).all()
    np.testing.assert_allclose(tau, 50.0 * q, atol=1e-9)  # as far on its way as the joints are on theirs
    assert tau[-1] == 5.0


def spring(q) -> np.ndarray:
    """What the torque of a posture is, for the tests below [N m]."""
    return 50.0 * q


class Holding(Bench):
    """A loop whose service knows the torque of every posture; an arm that follows goes to one radian, all joints.

    Attributes:
        questions: How many commands had been sent when a torque was asked for.
    """

    def __init__(self) -> None:
        super().__init__(feed_forward=True)
        self.questions: list[int] = []
        self.service.says = self.knows

    def knows(self, q) -> SolveReply:
        if self.service.options[-1]["collision"] != "off":
            return answer(np.ones(N), tau=spring(np.full(N, 2.0)), boot_id=self.service.boot_id)
        self.questions.append(len(self.robot.commands))
        return answer(q, tau=spring(q), boot_id=self.service.boot_id)

    def has_the_torque_of_its_posture(self, arm=slice(None)) -> bool:
        last = self.robot.commands[-1]
        return at_rest(self.robot.commands) and bool(np.abs(last.tau - spring(last.q))[arm].max() <= 1e-6)

    def largest_change(self, since: int) -> float:
        return float(np.abs(np.diff([command.tau for command in self.robot.commands[since:]], axis=0)).max())


def test_an_arm_that_brakes_gets_the_torque_of_where_it_rests_evenly():
    """Asked for once, when the command of that tick is on its way."""
    bench = Holding()
    bench.engage()
    bench.ticks(5)
    assert not bench.has_the_torque_of_its_posture()
    bench.tracker.grip = [False, False]
    before, asked = len(bench.robot.commands), len(bench.questions)
    bench.ticks(60)
    assert bench.has_the_torque_of_its_posture()
    assert bench.questions[asked:] == [before + 1]
    assert bench.largest_change(before - 1) <= RATE * TICK * SLACK
    bench.assert_bounded()


def test_an_arm_that_waits_for_the_other_gets_the_torque_of_where_it_rests():
    bench = Holding()
    bench.engage()
    bench.ticks(5)
    bench.tracker.grip = [True, False]
    reports = bench.ticks(60)  # the answer moves both arms to one
    assert bench.loop.states[0] is ArmState.ACTIVE
    assert reports[-1].reason == "the right arm, which holds, is in the way"
    assert bench.has_the_torque_of_its_posture()


def test_an_arm_that_stands_before_the_body_gets_the_torque_of_where_it_stands():
    bench = Holding()
    bench.stand_before_a_wall()
    bench.engage()
    assert bench.ticks(100)[-1].state is LoopState.TRACKING
    assert bench.robot.commands[-1].q.max() < 0.4
    assert bench.has_the_torque_of_its_posture()


@pytest.mark.parametrize("name", FAULTS)
def test_a_torque_that_cannot_be_told_stays_and_is_asked_for_again(name):
    said, _ = FAULTS[name]
    bench = Holding()
    bench.engage()
    before = bench.ticks(5)[-1].command.tau
    bench.service.says = lambda q: said
    bench.tracker.grip = [False, False]
    reports = bench.ticks(60)
    np.testing.assert_array_equal([report.command.tau for report in reports], [before] * len(reports))
    assert {report.reason for report in reports} <= {"the grip was released", "hold for too long"}
    bench.service.says = bench.knows
    bench.ticks(60)
    assert bench.has_the_torque_of_its_posture()


def test_a_silent_service_is_not_asked_twice_in_a_tick():
    """Hazard: loop overrun. Each question may take half a tick."""
    bench = Holding()
    bench.engage()
    bench.ticks(5)
    asked: list[float] = []

    def silence(_q):
        asked.append(bench.now)
        return ServiceTimeout(URL, 0.01)

    bench.service.says = bench.service.knows = bench.service.measures = silence
    bench.ticks(60)
    assert len(asked) == len(set(asked))
    assert len(asked) > 5


def test_another_run_of_the_service_that_tells_a_torque_disarms_what_is_under_way():
    """Hazard: service restart."""
    bench = Holding()
    bench.engage()
    bench.ticks(5)
    bench.service.boot_id = "b"
    bench.tracker.grip = [False, False]
    bench.ticks(2)
    assert bench.loop.states == (ArmState.DISARMED,) * 2


@pytest.mark.parametrize("silent", [False, True])
def test_a_run_ends_when_the_arms_rest(silent):
    bench = Holding()
    bench.engage()
    bench.ticks(5)
    if silent:
        bench.service.says = bench.service.knows = lambda q: ServiceTimeout(URL, 0.01)
    moved = bench.robot.commands[-1].q.copy()
    pacer = Pacer(TICK, lambda: bench.now, lambda seconds: None)
    before = len(bench.robot.commands)
    come_to_rest(bench.loop, "the end", bench.tick, pacer)
    assert bench.loop.rests
    assert at_rest(bench.robot.commands)
    assert bench.has_the_torque_of_its_posture() is not silent
    assert 5 < len(bench.robot.commands) - before <= LONGEST / TICK + 1
    assert np.abs(bench.robot.commands[-1].q - moved).max() > 0.05
    come_to_rest(bench.loop, "again", bench.tick, pacer)  # nothing is left to be done
    assert len(bench.robot.commands) - before <= LONGEST / TICK + 2


def test_a_run_ends_although_the_arms_never_rest():
    """A limiter that never stops, or a robot's end that moves its joints on and on."""
    ticks: list[int] = []
    loop: Any = SimpleNamespace(rests=False, stop=lambda reason: ticks.append(0))
    come_to_rest(loop, "the end", lambda: ticks.append(1), Pacer(TICK, lambda: 0.0, lambda seconds: None))
    assert ticks == [0] + [1] * (round(LONGEST / TICK) + 1)


def test_without_feed_forward_there_is_no_torque():
    bench = Bench()
    bench.service.says = lambda q: answer(np.ones(N), tau=np.full(N, np.nan))
    report = bench.engage()
    assert report.state is LoopState.TRACKING  # a torque that is not used is not looked at
    np.testing.assert_array_equal(report.command.tau, np.zeros(N))


def test_smoothing_sees_only_usable_answers_of_this_grip():
    bench = Bench(smoothing=WeightedMovingFilter())
    for grip in range(2):  # what was answered before a hold is forgotten
        bench.service.says = lambda q: answer(np.full(N, 0.5))
        bench.engage() if grip else bench.tick()
        bench.tracker.grip = [False, False]
        bench.ticks(10)
    bench.service.says = lambda q: answer(np.full(N, 7.0), status=Status.NOT_CONVERGED)
    bench.engage()
    values = [0.001, 0.002, 0.003, 0.004]
    for value in values:
        bench.service.says = lambda q, value=value: answer(np.full(N, value))
        bench.tick()
        bench.service.says = lambda q: answer(np.full(N, 7.0), status=Status.NOT_CONVERGED)
        bench.tick()
    mean = float(np.dot([0.4, 0.3, 0.2, 0.1], values[::-1]))
    bench.service.says = lambda q: answer(np.full(N, values[-1]))  # the same sample again is not counted again
    bench.ticks(40)
    np.testing.assert_allclose(bench.robot.commands[-1].q, np.full(N, mean), rtol=1e-9)


def test_stop_has_stopped_when_it_returns():
    """Hazard: stop path broken."""
    bench = Bench()
    bench.engage()
    bench.ticks(5)
    bench.loop.stop("the spotter said stop")
    assert bench.loop.states == (ArmState.DISARMED,) * 2
    report = bench.tick()
    assert (report.state, report.reason) == (LoopState.HOLDING, "the spotter said stop")
    assert not report.command.engaged
    bench.ticks(100)  # the grip is still held, and counts no longer
    assert at_rest(bench.robot.commands)
    bench.assert_bounded()
    bench.engage()


def test_a_fault_is_latched_until_cleared():
    bench = Bench()
    bench.engage()
    bench.loop.fault("a motor is hot")
    report = bench.tick()
    assert [step.state for step in report.arms] == [ArmState.FAULT] * 2
    assert report.reason == "a motor is hot"
    for grip in (False, True):
        bench.tracker.grip = [grip, grip]
        bench.ticks(20)
        assert bench.loop.states == (ArmState.FAULT,) * 2
    bench.loop.clear()
    bench.tick()
    assert bench.loop.states == (ArmState.DISARMED,) * 2
    bench.engage()


def test_release_is_the_last_word():
    """Hazard: weight ramp / exit. The robot's end is told on purpose; nothing else makes it take the arms back."""
    bench = Bench()
    bench.loop.release()  # nothing was commanded yet, so there is nothing to give back
    assert not bench.robot.commands
    bench.engage()
    bench.loop.release()
    last = bench.robot.commands[-1]
    assert last.release
    assert not last.engaged
    assert not any(command.release for command in bench.robot.commands[:-1])
    assert bench.loop.states == (ArmState.DISARMED,) * 2


@pytest.mark.parametrize("gap", [0.0, 1e-6, 0.05, 3.0, -1.0])
def test_a_tick_that_comes_too_early_or_late_keeps_the_step_bounded(gap):
    """Hazard: loop overrun. However long a tick took, the next command is at most two periods further."""
    bench = Bench()
    bench.engage()
    bench.ticks(12)
    before = bench.robot.commands[-1].q
    bench.now += gap
    report = bench.loop.tick()
    assert np.abs(report.command.q - before).max() <= 2 * TICK * LIMITS.velocity * SLACK


def test_the_bounds_would_break_without_the_limiter():
    """The negative control of every bound above."""

    class NoLimiter:
        resting_point = np.zeros(N)

        def limit(self, q_last, q_wanted, dt=None):
            return np.where(np.isfinite(q_wanted), q_wanted, q_last)

    bench = Bench()
    bench.loop._limiter, bench.loop._way = NoLimiter(), None
    bench.engage()
    with pytest.raises(AssertionError):
        bench.assert_bounded()


ANY_VECTOR = hnp.arrays(np.float64, st.sampled_from([N, N, N, 13]), elements=st.floats() | st.floats(-3, 3))
EVENTS = st.one_of(
    st.sampled_from([said for said, _ in FAULTS.values()]),
    st.builds(lambda q, tau: answer(q, tau=tau), ANY_VECTOR, ANY_VECTOR),
    st.sampled_from(["no hands", "grip", "let go", "left only", "deaf robot", "lets go", "another run", "stop"]),
)


@given(st.lists(st.tuples(EVENTS, ANY_VECTOR), max_size=20), st.booleans(), st.booleans())
def test_whatever_happens_every_tick_sends_one_bounded_command(events, feed_forward, smooth):
    """Hazard: velocity / acceleration / jerk, for all inputs."""
    bench = Bench(feed_forward=feed_forward, smoothing=WeightedMovingFilter() if smooth else None)
    bench.engage()
    for said, measured in events:
        bench.robot.q = measured
        bench.robot.fault = OSError("bus off") if said == "deaf robot" else None
        bench.robot.says = {"following": False, "q_set": measured} if said == "lets go" else {}
        bench.tracker.says = (lambda now: None) if said == "no hands" else bench.tracker.look
        if said in ("grip", "let go", "left only"):
            bench.tracker.grip = [said != "let go", said == "grip"]
        if said == "another run":
            bench.service.boot_id += "x"
        if said == "stop":
            bench.loop.stop()
        boot_id = bench.service.boot_id
        bench.service.says = lambda q, said=said, boot_id=boot_id: (
            answer(np.zeros(N), boot_id=boot_id) if isinstance(said, str) else said
        )
        sent = len(bench.robot.commands)
        report = bench.tick()
        assert len(bench.robot.commands) == sent + 1
        assert np.isfinite(report.command.q).all()
        assert np.isfinite(report.command.tau).all()
        active = [step.state is ArmState.ACTIVE for step in report.arms]
        assert [target is not None for target in report.targets] == active
        if report.state is LoopState.HOLDING:
            assert report.reason
        else:
            assert any(active)
    bench.tracker.says, bench.robot.says = (lambda now: None), {}
    bench.ticks(30)
    assert at_rest(bench.robot.commands)
    bench.assert_bounded()
