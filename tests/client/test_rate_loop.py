"""The rate loop's rules, with a clock, a robot, an operator and a service that do what the test says."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_client import ArmState, Command, ProtocolMismatch, Refused, RobotState, ServiceTimeout, ServiceUnavailable
from ik_client.ending import LONGEST, come_to_rest
from ik_client.homing import Homing
from ik_client.joint_limiter import JointLimiter, MotionLimits
from ik_client.pacer import Pacer
from ik_client.rate_loop import RateLoop
from ik_client.rate_types import RateLaw, RateReport, Wish
from ik_proto import ClearanceReply, FkReply, SolveReply, Status, VelocityReply

pytest.importorskip("ruckig")

N = 14
TICK = 0.005
LIMITS = MotionLimits(velocity=3.0, acceleration=20.0, jerk=10_000.0)
SLACK = 1.0 + 1e-6
SPEED = 0.4
"""What the stand-in answers while it is asked for a motion [rad/s]."""


class Robot:
    """Is where it was sent to, unless told otherwise; remembers its commands."""

    def __init__(self) -> None:
        self.q: np.ndarray | None = None
        self.says: dict = {}
        self.commands: list[Command] = []
        self.fault: Exception | None = None

    def read(self) -> RobotState:
        if self.fault:
            raise self.fault
        q = self.q if self.q is not None else self.commands[-1].q.copy() if self.commands else np.zeros(N)
        return RobotState(q, np.zeros(N), 0.0, **self.says)

    def send(self, command: Command) -> None:
        self.commands.append(command)


class Operator:
    """Wants what the test says."""

    def __init__(self) -> None:
        self.held: bool | None = False
        self.twists = np.zeros((2, 6))
        self.adds: dict = {}
        self.says: Callable[[float], Wish | None] = lambda now: Wish(self.twists, self.held, now, **self.adds)

    def wish(self, now: float) -> Wish | None:
        return self.says(now)


class Service:
    """Answers by a rule; an exception for an answer is raised."""

    def __init__(self) -> None:
        self.boot_id = "a"
        self.velocities: Callable[[], VelocityReply | Exception] = lambda: self.answer(np.full(N, SPEED))
        self.fault: Exception | None = None
        self.asked: list[dict] = []
        self.tau = np.arange(N, dtype=float)

    def head(self, status=Status.OK) -> dict:
        error = "" if status.success else "no"
        return {"success": status.success, "error": error, "status": status, "boot_id": self.boot_id}

    def answer(self, dq, status=Status.OK) -> VelocityReply:
        return VelocityReply(
            **self.head(status),
            dq=dq,
            twists=np.full((2, 6), 0.05),
            manipulability=np.array([0.01, 0.02]),
            damping=np.zeros(2),
            limited_by=("", "joint"),
            limiting_joint=(None, "right_elbow_joint"),
        )

    def velocity(self, left_twist, right_twist, q, dq=None, **options) -> VelocityReply:
        if self.fault:
            raise self.fault
        self.asked.append({"twists": np.array([left_twist, right_twist]), "q": q, "dq": dq, **options})
        said = self.velocities()
        if isinstance(said, Exception):
            raise said
        # As the real one: no motion where none is asked for.
        return said if np.any([left_twist, right_twist]) else replace(said, dq=0.0 * np.asarray(said.dq))

    def fk(self, q, waist=None) -> FkReply:
        if self.fault:
            raise self.fault
        return FkReply(**self.head(), left_wrist=np.eye(4), right_wrist=np.eye(4))

    def solve(self, left_wrist, right_wrist, q, dq, **options) -> SolveReply:
        zero = np.zeros(2)
        return SolveReply(**self.head(), sol_q=q, tau=self.tau, position_error=zero, rotation_error=zero)

    def clearance(self, q, waist=None) -> ClearanceReply:
        if self.fault:
            raise self.fault
        return ClearanceReply(**self.head(), clearance=np.ones(len(q)), nearest=("a", "b"))


class Bench:
    """A loop and everything around it."""

    def __init__(self, **options) -> None:
        self.robot, self.operator, self.service = Robot(), Operator(), Service()
        self.now = 0.0
        limiter = JointLimiter(N, TICK, LIMITS)
        self.loop = RateLoop(self.service, self.operator, self.robot, limiter, clock=lambda: self.now, **options)

    def tick(self) -> RateReport:
        self.now += TICK
        return self.loop.tick()

    def ticks(self, count: int) -> list[RateReport]:
        return [self.tick() for _ in range(count)]

    def press(self) -> None:
        """Open, then held, until the arms are active."""
        self.operator.held = False
        self.ticks(2)
        self.operator.held = True
        self.ticks(2)
        assert self.loop.state is ArmState.ACTIVE

    def moving(self) -> None:
        """Active, and at speed."""
        self.press()
        self.operator.twists = np.full((2, 6), 0.1)
        self.ticks(40)
        assert self.velocities()[-1] == pytest.approx(np.full(N, SPEED), rel=1e-3)

    def velocities(self) -> np.ndarray:
        return np.diff([command.q for command in self.robot.commands], axis=0) / TICK

    def rests(self, within: float = 0.1) -> bool:
        """Whether the arms come to rest, and stay there."""
        self.ticks(round(within / TICK))
        before = self.robot.commands[-1].q
        self.ticks(100)
        return np.array_equal(before, self.robot.commands[-1].q)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def bounded(bench: Bench) -> None:
    v = bench.velocities()
    assert np.abs(v).max() <= 3.0 * SLACK
    assert np.abs(np.diff(v, axis=0)).max() / TICK <= 20.0 * SLACK


def test_it_moves_while_the_switch_is_held_and_brakes_when_it_is_let_go(bench):
    bench.moving()
    assert bench.tick().moving
    bench.operator.held = False
    report = bench.tick()
    assert (report.state, report.moving) == (ArmState.HOLD, False)
    assert report.reason == "the hold-to-run switch was released"
    v = bench.velocities()
    assert (v[-1] < v[-2]).all()  # in that very tick
    assert bench.rests()
    bounded(bench)


def test_held_at_the_start_arms_nothing(bench):
    bench.operator.held = True
    bench.operator.twists = np.ones((2, 6))
    assert {report.state for report in bench.ticks(100)} == {ArmState.DISARMED}
    assert not bench.velocities().any()
    bench.press()


def test_velocities_are_integrated_from_the_last_command(bench):
    bench.moving()
    for command, asked in zip(bench.robot.commands[-10:-1], bench.service.asked[-9:], strict=True):
        np.testing.assert_array_equal(asked["q"], command.q)
        assert asked["period"] == TICK
    # ... and not from the measured joints, which lag behind.
    bench.robot.q = bench.robot.commands[-1].q - 0.05
    bench.tick()
    np.testing.assert_array_equal(bench.service.asked[-1]["q"], bench.robot.commands[-2].q)
    # What the service is told of the velocity is what was commanded.
    np.testing.assert_allclose(bench.service.asked[-1]["dq"], bench.velocities()[-2], atol=1e-3)


def test_an_answer_within_the_services_own_bounds_passes_exactly(bench):
    """The hand keeps its direction only where no joint is limited on its own."""
    bench.press()
    bench.operator.twists = np.full((2, 6), 0.1)
    wanted = np.zeros(N)
    goal = np.linspace(-0.5, 0.5, N)
    for _ in range(40):
        wanted = wanted + np.clip(goal - wanted, -12.0 * TICK, 12.0 * TICK)
        bench.service.velocities = lambda wanted=wanted: bench.service.answer(wanted)
        bench.tick()
        np.testing.assert_allclose(bench.velocities()[-1], wanted, atol=1e-12)


def test_before_a_press_it_is_where_the_robots_end_holds_its_joints():
    bench = Bench()
    held = np.linspace(0.0, 0.05, N)
    bench.robot.q, bench.robot.says = held + 0.02, {"q_set": held, "following": False}
    bench.ticks(20)
    np.testing.assert_array_equal(bench.robot.commands[-1].q, held)
    assert np.abs(bench.velocities()).max() == 0.0


def test_arms_that_are_not_where_they_are_commanded_are_not_engaged(bench):
    bench.tick()
    bench.robot.q = np.full(N, 0.2)
    bench.operator.held = True
    bench.ticks(50)
    assert bench.loop.state is ArmState.ALIGNING
    assert not any(command.engaged for command in bench.robot.commands)


@pytest.mark.parametrize("gone", [None, "silent", "raises", "no numbers"])
def test_an_operator_who_is_gone_disarms_and_coming_back_moves_nothing(bench, gone):
    """Unplugged, silent, or nonsense: braked in that tick; the switch still held afterwards counts for nothing.

    Hazard: switch gone.
    """
    bench.moving()
    healthy, then = bench.operator.says, bench.now

    def raising(_now):
        raise OSError("device lost")

    bench.operator.says = {
        None: lambda now: Wish(bench.operator.twists, None, now),
        "silent": lambda now: Wish(bench.operator.twists, True, then - 0.2),
        "raises": raising,
        "no numbers": lambda now: Wish(np.full((2, 6), np.nan), True, now),
    }[gone]
    report = bench.tick()
    assert (report.state, report.moving) == (ArmState.DISARMED, False)
    assert report.reason
    assert (bench.velocities()[-1] < bench.velocities()[-2]).all()
    assert bench.rests()
    bench.operator.says = healthy
    assert bench.rests(0.0)
    assert not bench.robot.commands[-1].engaged
    bench.press()
    bounded(bench)


def test_stop_is_a_press_away_from_going_on(bench):
    bench.moving()
    bench.operator.adds = {"stop": True}
    assert bench.tick().reason == "stopped by the operator"
    bench.operator.adds = {}
    assert bench.rests()
    assert bench.loop.state is ArmState.DISARMED
    bench.press()
    bench.loop.stop()
    assert bench.loop.state is ArmState.DISARMED


FAULTS = {
    "late": ServiceTimeout("tcp://x", 0.01),
    "gone": ServiceUnavailable("tcp://x", "nobody answers"),
    "wrong": ProtocolMismatch("tcp://x", "junk"),
    "refused": Refused(Status.OVERLOADED, "busy", None) if hasattr(Status, "OVERLOADED") else ValueError("busy"),
    "any": RuntimeError("what"),
}
ANSWERS = {
    "nan": np.full(N, np.nan),
    "infinite": np.full(N, np.inf),
    "short": np.full(N - 1, 0.1),
    "a matrix": np.zeros((N, N)),
    "too fast": np.full(N, 2.0),
}


@pytest.mark.parametrize("fault", [*FAULTS, *ANSWERS, "no success"])
def test_an_answer_that_is_none_brakes_in_that_tick_and_a_short_one_is_got_over(bench, fault):
    bench.moving()
    healthy = bench.service.velocities

    def said():
        if fault in FAULTS:
            return FAULTS[fault]
        if fault in ANSWERS:
            return bench.service.answer(ANSWERS[fault])
        return bench.service.answer(np.full(N, SPEED), next(s for s in Status if not s.success))

    bench.service.velocities = said
    report = bench.tick()
    assert not report.moving
    assert report.reason
    assert (bench.velocities()[-1] < bench.velocities()[-2]).all()
    bench.service.velocities = healthy
    bench.ticks(40)
    assert bench.loop.state is ArmState.ACTIVE
    assert bench.velocities()[-1] == pytest.approx(np.full(N, SPEED), rel=1e-3)
    # For longer: it holds, then disarms, and going on takes a press.
    bench.service.velocities = said
    bench.ticks(30)
    assert bench.loop.state is ArmState.HOLD
    bench.ticks(round(0.6 / TICK))
    assert bench.loop.state is ArmState.DISARMED
    bench.service.velocities = healthy
    assert bench.rests()
    bench.press()
    bounded(bench)


def test_another_run_of_the_service_disarms(bench):
    bench.moving()
    bench.service.boot_id = "b"
    assert not bench.tick().moving
    report = bench.tick()
    assert report.state is ArmState.DISARMED
    assert "another run" in report.reason
    assert bench.rests()
    bench.press()


def test_a_robot_that_is_silent_or_lets_go_disarms(bench):
    bench.moving()
    bench.robot.fault = OSError("silent")
    assert not bench.tick().moving
    assert bench.loop.state is ArmState.HOLD
    bench.ticks(round(0.6 / TICK))
    bench.robot.fault = None
    assert bench.rests()
    assert bench.loop.state is ArmState.DISARMED
    bench.moving()
    bench.robot.says = {"following": False, "note": "busy"}
    bench.ticks(round(0.3 / TICK))
    assert bench.loop.state is ArmState.DISARMED


def test_home_is_gone_to_only_while_asked_for_and_straight():
    """Hazard: homing."""
    home = np.linspace(-0.3, 0.3, N)
    bench = Bench(homing=Homing(home))
    bench.operator.adds = {"home": True}
    bench.ticks(50)
    assert not bench.velocities().any()  # the button alone does nothing
    bench.press()
    reports = bench.ticks(round(3.0 / TICK))
    assert all(report.homing for report in reports)
    assert reports[-1].at_home
    q = np.array([command.q for command in bench.robot.commands])
    way = home / np.linalg.norm(home)
    assert np.abs(q - np.outer(q @ way, way)).max() < 1e-9
    assert np.abs(bench.velocities()).max() <= 0.5 * SLACK
    bounded(bench)
    bench.operator.adds = {"home": True}
    bench.operator.held = False
    bench.tick()
    assert bench.rests()


def test_no_step_goes_where_the_arms_are_not_clear(bench):
    bench.moving()
    start = bench.robot.commands[-1].q[0]

    def clearance(q, waist=None):
        """The first joint moves towards something that is 50 mm off, a metre a radian."""
        return ClearanceReply(**bench.service.head(), clearance=0.05 - (q[:, 0] - start), nearest=("a", "b"))

    bench.service.clearance = clearance
    bench.ticks(200)
    nearest = min(0.05 - (command.q[0] - start) for command in bench.robot.commands)
    assert 0.005 <= nearest <= 0.02
    # It may leave at any time.
    bench.service.velocities = lambda: bench.service.answer(np.full(N, -SPEED))
    bench.ticks(100)
    assert bench.robot.commands[-1].q[0] < start


def test_where_clearance_cannot_be_told_it_brakes(bench):
    bench.moving()

    def lost(q, waist=None):
        raise ServiceTimeout("tcp://x", 0.01)

    bench.service.clearance = lost
    report = bench.tick()
    assert not report.moving
    assert (bench.velocities()[-1] < bench.velocities()[-2]).all()


def test_without_avoidance_clearance_is_not_asked_for():
    bench = Bench(law=RateLaw(collision="off"))
    bench.service.clearance = None  # ty: ignore[invalid-assignment]
    bench.moving()
    assert bench.service.asked[-1]["collision"] == "off"


def test_gravity_torque_goes_along_and_stays_when_it_cannot_be_told(bench):
    bench.moving()
    np.testing.assert_array_equal(bench.robot.commands[-1].tau, bench.service.tau)
    bench.service.fault = ServiceUnavailable("tcp://x", "nobody answers")
    bench.ticks(100)
    np.testing.assert_array_equal(bench.robot.commands[-1].tau, np.arange(N))


@pytest.mark.parametrize("silent", [False, True])
def test_a_run_ends_when_the_arms_rest_with_the_torque_of_that_posture(silent):
    bench = Bench()
    solve = bench.service.solve

    def springs(left_wrist, right_wrist, q, dq, **options):
        return replace(solve(left_wrist, right_wrist, q, dq, **options), tau=10.0 * q)

    bench.service.solve = springs
    bench.moving()
    assert not bench.loop.rests
    bench.service.fault = ServiceTimeout("tcp://x", 0.01) if silent else None

    def pause(seconds: float) -> None:
        bench.now += seconds

    begin = bench.now
    come_to_rest(bench.loop, "the end", bench.tick, Pacer(TICK, lambda: bench.now, pause))
    assert bench.loop.rests
    assert bench.now - begin <= LONGEST
    last = bench.robot.commands[-1]
    assert not bench.velocities()[-1].any()
    assert np.allclose(last.tau, 10.0 * last.q, atol=1e-9) is not silent


def test_the_torque_that_the_robot_holds_is_kept_until_it_is_known():
    bench = Bench()
    bench.service.fault = ServiceUnavailable("tcp://x", "nobody answers")
    bench.robot.says = {"tau_set": np.full(N, 2.0), "q_set": np.zeros(N)}
    bench.ticks(5)
    np.testing.assert_array_equal(bench.robot.commands[-1].tau, np.full(N, 2.0))


def test_a_command_tells_how_the_wrists_were_asked_to_move(bench):
    bench.moving()
    motion = bench.robot.commands[-1].motion
    assert motion is not None
    np.testing.assert_array_equal(motion.twists, bench.operator.twists)
    assert motion.limited_by == ("", "joint")
    bench.operator.held = False
    bench.tick()
    assert bench.robot.commands[-1].motion is None


def test_twists_along_the_hands_axes_are_shown_in_the_pelvis_frame(bench):
    turned = np.eye(4)
    turned[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    bench.service.fk = lambda q, waist=None: FkReply(**bench.service.head(), left_wrist=turned, right_wrist=np.eye(4))
    bench.operator.adds = {"frame": "hand"}
    bench.moving()
    assert bench.service.asked[-1]["frame"] == "hand"
    bench.operator.twists = np.array([[0.1, 0, 0, 0, 0, 0.2], [0.1, 0, 0, 0, 0, 0]])
    bench.tick()
    motion = bench.robot.commands[-1].motion
    np.testing.assert_allclose(motion.twists, [[0, 0.1, 0, 0, 0, 0.2], [0.1, 0, 0, 0, 0, 0]], atol=1e-15)


def test_idle_it_finds_out_now_and_then_how_the_service_is(bench):
    bench.ticks(100)
    assert 4 <= len(bench.service.asked) <= 6
    bench.service.fault = ServiceUnavailable("tcp://x", "nobody answers")
    bench.ticks(100)
    bench.operator.held = True
    bench.ticks(10)
    assert bench.loop.state is ArmState.DISARMED  # a press for a service that is not there is void
    bench.service.fault = None
    bench.ticks(50)
    assert bench.loop.state is ArmState.DISARMED
    bench.press()


def test_released_it_says_so_once(bench):
    bench.moving()
    bench.loop.release()
    assert bench.robot.commands[-1].release
    assert not bench.robot.commands[-1].engaged


@given(
    story=st.lists(st.sampled_from(["held", "open", "gone", *FAULTS, *ANSWERS, "robot", "boot", "home"]), max_size=25)
)
def test_whatever_happens_every_tick_sends_one_bounded_command_and_none_moves_without_a_held_switch(story):
    bench = Bench()
    bench.operator.twists = np.full((2, 6), 0.1)
    bench.press()
    healthy = bench.service.velocities
    for event in story:
        bench.operator.held = {"open": False, "gone": None}.get(event, True)
        bench.operator.adds = {"home": event == "home"}
        bench.robot.fault = OSError("silent") if event == "robot" else None
        bench.service.boot_id = "b" if event == "boot" else "a"
        bench.service.velocities = healthy
        if event in FAULTS:
            bench.service.velocities = lambda event=event: FAULTS[event]
        elif event in ANSWERS:
            bench.service.velocities = lambda event=event: bench.service.answer(ANSWERS[event])
        before = len(bench.robot.commands)
        reports = bench.ticks(10)
        assert len(bench.robot.commands) == before + 10
        if event in ("open", "gone"):
            assert not any(report.moving for report in reports)
    bounded(bench)
    seqs = [command.seq for command in bench.robot.commands]
    assert seqs == list(range(1, len(seqs) + 1))
