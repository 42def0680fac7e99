"""The scripted operator: grips a robot that is ready, moves along, and grips again after having been disarmed."""

import numpy as np
from sim_fakes import FakeClock, FakeSolver, steps_to

from ik_client import ArmState, Command, LoopState, StepLimiter, TeleopLoop, TickReport
from ik_proto import Array
from ik_proto.robots import RobotDescription
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.sources import REGRIP_TIME, ScriptedOperator, scripted_arm
from sim_client.trace import Tick

EYE = np.eye(4)


class Steps:
    """A motion that tells the time."""

    length = None

    def poses(self, time: float) -> tuple[Array, Array]:
        T = np.eye(4)
        T[0, 3] = time
        return T, T


class Bench:
    def __init__(self) -> None:
        self.ready = False
        self.operator = ScriptedOperator(Steps(), lambda: self.ready)

    def look(self, now: float) -> tuple[bool | None, float]:
        """Whether the operator grips, and how far the motion has come."""
        hands = self.operator.hands(now)
        assert hands.left is not None
        assert hands.right is not None
        assert hands.left.grip == hands.right.grip
        return hands.left.grip, float(hands.left.pose[0, 3])

    def disarm(self, now: float) -> None:
        report = TickReport(
            now, LoopState.HOLDING, "restarted", Command(np.zeros(4), np.zeros(4), now), steps_to(EYE, None)
        )
        self.operator.observe(Tick(0, now, report, np.zeros(5), (EYE, EYE), 0.0, 0.001))


def test_it_grips_once_the_robot_is_ready_and_the_motion_begins_then():
    bench = Bench()
    assert [bench.look(now) for now in (10.0, 11.0, 12.0)] == [(False, 0.0)] * 3
    bench.ready = True
    assert bench.look(13.0) == (True, 0.0)
    assert bench.look(13.5) == (True, 0.5)


def test_the_first_look_never_grips():
    """A grip counts only after it was seen open."""
    bench = Bench()
    bench.ready = True
    assert [bench.look(now)[0] for now in (0.0, 0.02)] == [False, True]


def test_disarmed_it_lets_go_waits_and_grips_again_while_the_motion_goes_on():
    bench = Bench()
    bench.ready = True
    bench.look(0.0)
    bench.look(1.0)
    bench.disarm(3.0)
    assert bench.look(3.02) == (False, 2.02)
    assert bench.look(3.0 + 0.99 * REGRIP_TIME)[0] is False
    bench.ready = False
    assert bench.look(3.0 + 1.5 * REGRIP_TIME)[0] is False
    bench.ready = True
    assert bench.look(3.0 + 1.6 * REGRIP_TIME)[0] is True


def test_script_and_robot_get_going_and_on_after_a_stop(toy: RobotDescription) -> None:
    clock = FakeClock()
    robot = SimRobot(toy, clock=clock, ramp=0.1)
    operator = ScriptedOperator(Steps(), lambda: robot.read().ready)
    loop = TeleopLoop(
        FakeSolver(clock), operator, robot, StepLimiter(0.04), arms=(scripted_arm(), scripted_arm()), clock=clock
    )

    def run(seconds: float) -> list[LoopState]:
        states = []
        for k in range(round(seconds / CONTROL_PERIOD)):
            report = loop.tick()
            robot.advance()
            operator.observe(Tick(k, robot.time, report, robot.data.qpos.copy(), robot.wrists(), 0.0, 0.001))
            states.append(report.state)
            clock.now += CONTROL_PERIOD - 0.001
        return states

    states = run(1.0)
    assert states[0] is LoopState.HOLDING
    assert set(states[-30:]) == {LoopState.TRACKING}
    loop.stop()
    assert loop.states == (ArmState.DISARMED,) * 2
    states = run(2.0)
    assert states[:40] == [LoopState.HOLDING] * 40
    assert set(states[-30:]) == {LoopState.TRACKING}
