"""An operator without a tracker, for a simulated robot whose time is moved by hand."""

import numpy as np
from numpy.typing import ArrayLike

from ik_client import Command
from ik_client.robot_end import EndState
from ik_proto.robots import RobotDescription
from sim_client.robot import CONTROL_PERIOD, SimRobot

HOME = [0.4, 0.0, 0.0, -0.3]
"""Home of the small robot's arms [rad]."""


class Operator:
    """Sends what the test says, in order, to a robot whose weight rises in a tick unless told otherwise."""

    def __init__(self, description: RobotDescription, ramp: float = CONTROL_PERIOD) -> None:
        self.now = 0.0
        self.robot = SimRobot(description, clock=lambda: self.now, ramp=ramp)
        self._seq = 0

    def send(self, q: ArrayLike, tau: ArrayLike = 0.0, *, engaged: bool = False, release: bool = False) -> None:
        self._seq += 1
        joints = np.asarray(q, dtype=float)
        torque = np.broadcast_to(np.asarray(tau, dtype=float), joints.shape)
        self.robot.send(Command(joints, torque, 0.0, session="s", seq=self._seq, engaged=engaged, release=release))

    def advance(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.now += CONTROL_PERIOD
            self.robot.advance()

    def engage(self) -> None:
        """Take the arms and engage them where they are."""
        self.advance()
        for engaged in (False, False, True):
            self.send(self.robot.read().q, engaged=engaged)
            self.advance()
        assert self.robot.guard.state is EndState.FOLLOWING

    def go(self, ticks: int, q: ArrayLike, tau: ArrayLike = 0.0) -> None:
        for _ in range(ticks):
            self.send(q, tau, engaged=True)
            self.advance()
