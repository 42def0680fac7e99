"""Hazard row "rocking body": hands stand still, arms are outstretched, and the body is pushed. It comes to rest.

Loop, service and robot take turns on a clock of the test's own.
"""

from collections.abc import Callable

import numpy as np
import pytest

from ik_client import ArmState, IKClient, TeleopLoop
from ik_client.joint_limiter import JointLimiter
from ik_client.steady_waist import SteadyWaist
from ik_proto import Array
from ik_proto.robots import RobotDescription
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.sources import Approach, ScriptedOperator, scripted_arm

LEFT, RIGHT = (0.38, 0.2, 0.25), (0.38, -0.2, 0.25)
"""Where the hands are [m]."""

MOVING, RESTING, LOOK = 2.5, 1.0, 2.0
"""How long the hands move, how long the body may take to come to rest, and how long rest is looked at [s]."""

PUSH = 1.0
"""How fast the waist is made to roll [rad/s]."""


class Outstretched:
    """Both hands before the chest, arms outstretched."""

    length = None

    def poses(self, time: float) -> tuple[Array, Array]:
        left, right = np.eye(4), np.eye(4)
        left[:3, 3], right[:3, 3] = LEFT, RIGHT
        return left, right


class Run:
    """A loop and a robot."""

    def __init__(self, ik: IKClient, robot: RobotDescription, steady: SteadyWaist | None = None) -> None:
        self.now = 0.0
        self.robot = SimRobot(robot, clock=lambda: self.now, ramp=CONTROL_PERIOD)
        info = ik.info()
        limiter = JointLimiter(len(info.joint_names), CONTROL_PERIOD, lower=info.lower, upper=info.upper)
        motion = Approach(Outstretched(), self.robot.wrists(), duration=MOVING)
        operator = ScriptedOperator(motion, lambda: self.robot.read().ready)
        arms = (scripted_arm(), scripted_arm())
        self.loop = TeleopLoop(ik, operator, self.robot, limiter, arms=arms, feed_forward=True, clock=lambda: self.now)
        if steady is not None:
            self.loop._partners.waist = steady
        self.wait(lambda: self.loop.states == (ArmState.ACTIVE, ArmState.ACTIVE), 4.0)

    def wait(self, condition: Callable[[], bool], limit: float) -> None:
        end = self.now + limit
        while not condition():
            assert self.now < end
            self.ticks(CONTROL_PERIOD)

    def push(self) -> None:
        """Give the waist a sideways swing."""
        roll = self.robot.model.joint("waist_roll_joint").dofadr[0]
        self.robot.data.qvel[roll] += PUSH

    def ticks(self, seconds: float) -> tuple[Array, Array]:
        """Measured waist and left wrist in each tick, shapes (ticks, 3) [rad] and (ticks, 3) [m]."""
        waist, wrist = [], []
        for _ in range(round(seconds / CONTROL_PERIOD)):
            self.loop.tick()
            self.now += CONTROL_PERIOD
            self.robot.advance()
            waist.append(np.asarray(self.robot.read().waist))
            wrist.append(self.robot.wrists()[0][:3, 3])
        return np.array(waist), np.array(wrist)


@pytest.fixture
def ik(service_process):
    with IKClient(service_process.tcp_url, timeout=5.0) as client:
        yield client


def test_a_pushed_body_comes_to_rest(ik, g1):
    run = Run(ik, g1)
    run.ticks(MOVING + RESTING)
    run.push()
    run.ticks(RESTING)
    waist, wrist = run.ticks(LOOK)
    assert np.ptp(waist, axis=0).max() < 0.01
    assert np.linalg.norm(wrist - LEFT, axis=1).max() < 0.005


def test_it_would_not_if_the_arms_made_up_for_its_swing(ik, g1):
    """Negative control: the measured waist as it is."""
    run = Run(ik, g1, SteadyWaist(time_constant=1e-6))
    run.ticks(MOVING + RESTING)
    run.push()
    run.ticks(RESTING)
    waist, wrist = run.ticks(LOOK)
    assert np.ptp(waist, axis=0).max() > 0.5
    assert np.linalg.norm(wrist - LEFT, axis=1).max() > 0.1
