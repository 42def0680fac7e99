"""The teleop loop's rules, with a clock, a robot, a tracker and a service that do what the test says."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ik_client import (
    BadRequest,
    Command,
    LoopState,
    ProtocolMismatch,
    Refused,
    RobotState,
    Seed,
    ServiceTimeout,
    ServiceUnavailable,
    StepLimiter,
    TeleopLoop,
    TickReport,
    WeightedMovingFilter,
    WristTargets,
)
from ik_proto import SolveReply, Status

N = 14
STEP = 0.01
EYE = np.eye(4)


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
        self.q = np.zeros(N) if q is None else q
        self.dq = np.zeros(N)
        self.waist: np.ndarray | None = None
        self.commands: list[Command] = []
        self.fault: Exception | None = None

    def read(self) -> RobotState:
        if self.fault:
            raise self.fault
        return RobotState(self.q, self.dq, 0.0, self.waist)

    def send(self, command: Command) -> None:
        self.commands.append(command)


class Tracker:
    def __init__(self) -> None:
        self.says: Callable[[float], WristTargets | None] = lambda now: WristTargets(EYE, EYE, now)

    def targets(self, now: float) -> WristTargets | None:
        return self.says(now)


class Service:
    """Solves by a rule; an exception for an answer is raised."""

    def __init__(self) -> None:
        self.says: Callable[[np.ndarray], SolveReply | Exception] = lambda q: answer(np.ones(N))
        self.seeds: list[np.ndarray] = []
        self.asked: list[tuple[np.ndarray, ...]] = []
        self.options: list[dict] = []

    def solve(self, left_wrist, right_wrist, q, dq, **options) -> SolveReply:
        self.options.append(options)
        self.seeds.append(q)
        self.asked.append((left_wrist, right_wrist, q, dq))
        said = self.says(q)
        if isinstance(said, Exception):
            raise said
        return said


class Bench:
    """A loop and everything around it."""

    def __init__(self, q=None, **options) -> None:
        self.robot, self.tracker, self.service = Robot(q), Tracker(), Service()
        self.now = 0.0
        self.loop = TeleopLoop(
            self.service, self.tracker, self.robot, StepLimiter(STEP), clock=lambda: self.now, **options
        )

    def tick(self) -> TickReport:
        self.now += 0.02
        return self.loop.tick()

    def steps(self) -> np.ndarray:
        return np.abs(np.diff([command.q for command in self.robot.commands], axis=0))


def test_it_walks_to_the_answer_in_bounded_steps():
    bench = Bench()
    reports = [bench.tick() for _ in range(120)]
    assert all(report.state is LoopState.TRACKING and not report.reason for report in reports)
    assert (bench.steps() <= STEP).all()
    np.testing.assert_array_equal(bench.robot.commands[-1].q, np.ones(N))


def test_a_report_tells_what_happened():
    bench = Bench()

    def slow(q):
        bench.now += 0.003
        return answer(np.ones(N), boot_id="run-7")

    bench.service.says = slow
    report = bench.tick()
    assert report.time == pytest.approx(0.02)
    assert report.round_trip == pytest.approx(0.003)
    assert (report.status, report.solve_us, report.boot_id, report.seed) == (Status.OK, 8.0, "run-7", Seed.COMMAND)
    assert report.position_error is not None
    np.testing.assert_array_equal(report.position_error, [0.001, 0.002])
    assert report.command is bench.robot.commands[-1]
    assert report.targets is not None
    assert report.measured is not None


def test_the_measured_waist_and_what_the_tracker_adds_go_with_the_solve():
    bench = Bench(collision="report")
    bench.tick()
    assert bench.service.options[-1] == {
        "waist": None,
        "left_elbow": None,
        "right_elbow": None,
        "weights": None,
        "collision": "report",
    }
    waist, elbow, weights = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.0, -1.0, 0.5]), np.ones((2, 2))
    bench.robot.waist = waist
    bench.tracker.says = lambda now: WristTargets(EYE, EYE, now, left_elbow=elbow, right_elbow=-elbow, weights=weights)
    assert bench.tick().state is LoopState.TRACKING
    options = bench.service.options[-1]
    assert options["waist"] is waist
    assert options["left_elbow"] is elbow
    np.testing.assert_array_equal(options["right_elbow"], -elbow)
    assert options["weights"] is weights


def test_the_report_tells_the_clearance():
    bench = Bench()
    assert bench.tick().clearance is None
    bench.service.says = lambda q: replace(answer(np.ones(N), status=Status.BLOCKED), clearance=0.012)
    report = bench.tick()
    assert (report.state, report.status, report.clearance) == (LoopState.TRACKING, Status.BLOCKED, 0.012)


def test_the_first_command_starts_from_the_measured_joints():
    q = np.linspace(-1, 1, N)
    bench = Bench(q)
    bench.tick()
    assert (np.abs(bench.robot.commands[0].q - q) <= STEP).all()
    np.testing.assert_array_equal(bench.service.seeds[0], q)


def test_before_any_answer_it_holds_the_joints_measured_first():
    q = np.linspace(-1, 1, N)
    bench = Bench(q.copy())
    bench.tracker.says = lambda now: None
    for sag in range(5):
        bench.robot.q = q - 0.01 * sag
        report = bench.tick()
        assert report.state is LoopState.HOLDING
        np.testing.assert_array_equal(report.command.q, q)
        np.testing.assert_array_equal(report.command.tau, np.zeros(N))


def test_a_robot_that_reuses_its_buffer_does_not_move_the_held_command():
    bench = Bench(np.full(N, 0.5))
    bench.tracker.says = lambda now: None
    bench.tick()
    bench.robot.q[:] = -1.0
    np.testing.assert_array_equal(bench.tick().command.q, np.full(N, 0.5))


def test_commands_are_read_only():
    bench = Bench(feed_forward=True)
    command = bench.tick().command
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
def test_any_fault_of_the_service_holds_the_last_command_bit_for_bit(name):
    said, reason = FAULTS[name]
    bench = Bench(feed_forward=True)
    bench.service.says = lambda q: answer(np.ones(N), tau=np.full(N, 3.0))
    for _ in range(10):
        before = bench.tick().command
    bench.service.says = lambda q: said
    for _ in range(3):
        report = bench.tick()
        assert report.state is LoopState.HOLDING
        assert reason in report.reason
        assert "\n" not in report.reason
        assert (report.fault is said) is isinstance(said, Exception)
        assert report.command.q.tobytes() == before.q.tobytes()
        assert report.command.tau.tobytes() == before.tau.tobytes()
    assert len(bench.robot.commands) == 13
    bench.service.says = lambda q: answer(-np.ones(N), boot_id="b")
    report = bench.tick()
    assert report.state is LoopState.TRACKING
    assert report.boot_id == "b"
    assert (bench.steps() <= STEP).all()
    assert (report.command.q < before.q).all()


@pytest.mark.parametrize(
    ("says", "reason"),
    [
        (lambda now: None, "no targets"),
        (lambda now: WristTargets(EYE, EYE, now, valid=False), "targets are not valid"),
        (lambda now: 1 / 0, "ZeroDivisionError"),
    ],
)
def test_without_targets_it_holds_and_asks_nothing(says, reason):
    bench = Bench()
    before = bench.tick().command
    asked = len(bench.service.asked)
    bench.tracker.says = says
    report = bench.tick()
    assert report.state is LoopState.HOLDING
    assert reason in report.reason
    assert report.command.q.tobytes() == before.q.tobytes()
    assert report.round_trip is None
    assert len(bench.service.asked) == asked


@pytest.mark.parametrize(
    ("q", "dq", "fault"),
    [
        (np.full(N, np.nan), np.zeros(N), None),
        (np.zeros(N - 1), np.zeros(N), None),
        (np.zeros(N), np.full(N, np.inf), None),
        (np.zeros(N), np.zeros(N), OSError("bus off")),
    ],
)
def test_a_robot_that_cannot_be_read_is_told_to_hold(q, dq, fault):
    bench = Bench()
    before = bench.tick().command
    bench.robot.q, bench.robot.dq, bench.robot.fault = q, dq, fault
    report = bench.tick()
    assert report.state is LoopState.HOLDING
    assert report.command.q.tobytes() == before.q.tobytes()


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
    assert bench.tick().state is LoopState.TRACKING


def test_the_seed_is_the_command_while_it_agrees_with_the_measurement():
    bench = Bench(agreement=0.3)
    bench.tick()
    sagging = bench.robot.commands[-1].q - 0.2
    bench.robot.q = sagging
    assert bench.tick().seed is Seed.COMMAND
    np.testing.assert_array_equal(bench.service.seeds[-1], bench.robot.commands[-2].q)
    pushed = sagging.copy()
    pushed[5] += 0.6
    bench.robot.q = pushed
    report = bench.tick()
    assert report.seed is Seed.MEASURED
    np.testing.assert_array_equal(bench.service.seeds[-1], pushed)
    # Whatever it starts from, the command goes on from the last one.
    assert (bench.steps() <= STEP).all()


def test_a_sagging_arm_does_not_pull_the_command_down():
    """The seeds' fault: solving from the measured joints makes a lagging arm creep. Here the command stays."""
    bench = Bench()
    bench.service.says = lambda q: answer(q)  # nothing to do: stay where you start
    for _ in range(200):
        command = bench.tick().command
        bench.robot.q = command.q - 0.05
    np.testing.assert_array_equal(command.q, np.zeros(N))


def test_feed_forward_torque_arrives_with_the_joints():
    bench = Bench(feed_forward=True)
    bench.service.says = lambda q: answer(np.full(N, 0.1), tau=np.full(N, 5.0))
    torques = [bench.tick().command.tau[0] for _ in range(12)]
    assert (np.diff(torques) >= 0.0).all()
    assert np.max(np.diff(torques)) <= 0.5 + 1e-9  # a tenth of the way, a tenth of the torque
    assert torques[-1] == 5.0


def test_without_feed_forward_there_is_no_torque():
    bench = Bench()
    bench.service.says = lambda q: answer(np.ones(N), tau=np.full(N, np.nan))
    report = bench.tick()
    assert report.state is LoopState.TRACKING  # a torque that is not used is not looked at
    np.testing.assert_array_equal(report.command.tau, np.zeros(N))


def test_smoothing_sees_only_usable_answers():
    bench = Bench(smoothing=WeightedMovingFilter())
    values = [0.001, 0.002, 0.003, 0.004]
    for value in values:
        bench.service.says = lambda q, value=value: answer(np.full(N, value))
        bench.tick()
        bench.service.says = lambda q: answer(np.full(N, 7.0), status=Status.NOT_CONVERGED)
        bench.tick()
    expected = np.dot([0.4, 0.3, 0.2, 0.1], values[::-1])
    np.testing.assert_allclose(bench.robot.commands[-1].q, np.full(N, expected), rtol=1e-12)


def test_the_bounds_would_break_without_the_limiter():
    """The negative control of every step bound above."""

    class NoLimiter:
        def limit(self, q_last, q_wanted):
            return q_wanted.copy()

    bench = Bench()
    bench.loop._limiter = NoLimiter()
    bench.tracker.says = lambda now: WristTargets(EYE, EYE, now, valid=now > 0.03)
    bench.tick()
    bench.tick()
    assert not (bench.steps() <= STEP).all()


ANY_VECTOR = hnp.arrays(np.float64, st.sampled_from([N, N, N, 13]), elements=st.floats() | st.floats(-3, 3))
EVENTS = st.one_of(
    st.sampled_from([said for said, _ in FAULTS.values()]),
    st.builds(lambda q, tau: answer(q, tau=tau), ANY_VECTOR, ANY_VECTOR),
    st.sampled_from(["no targets", "invalid targets", "deaf robot"]),
)


@given(st.lists(st.tuples(EVENTS, ANY_VECTOR), max_size=20), st.booleans(), st.booleans())
def test_whatever_happens_every_tick_sends_one_bounded_command(events, feed_forward, smooth):
    bench = Bench(feed_forward=feed_forward, smoothing=WeightedMovingFilter() if smooth else None)
    last = bench.tick().command
    for said, measured in events:
        bench.robot.q = measured
        bench.robot.fault = OSError("bus off") if said == "deaf robot" else None
        valid = said != "invalid targets"
        bench.tracker.says = lambda now, said=said, valid=valid: (
            None if said == "no targets" else WristTargets(EYE, EYE, now, valid)
        )
        bench.service.says = lambda q, said=said: answer(np.zeros(N)) if isinstance(said, str) else said
        sent = len(bench.robot.commands)
        report = bench.tick()
        assert len(bench.robot.commands) == sent + 1
        assert np.isfinite(report.command.q).all()
        assert np.isfinite(report.command.tau).all()
        assert (np.abs(report.command.q - last.q) <= STEP).all()
        if report.state is LoopState.HOLDING:
            assert report.reason
            assert report.command.q.tobytes() == last.q.tobytes()
            assert report.command.tau.tobytes() == last.tau.tobytes()
        last = report.command
