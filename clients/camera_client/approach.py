"""The slow beginning of an arm that was not operated: it goes home, then to the operator's posture, then it follows.

| stage     | the arm goes                      | speed                | ends when it                         |
|-----------|-----------------------------------|----------------------|--------------------------------------|
| home      | to the robot's home posture       | slow                 | is there; once in a run              |
| coming    | to where the operator's arm is    | slow                 | is about where the operator's arm is |
| following | with the operator's arm           | rises to the full    | is disarmed                          |

- Slow is a bound on every joint's velocity, whatever the operator and the solver do. So a robot and an operator whose
  arms are far apart find together without haste, elbows included.
- All of it happens only while the switch is held: letting go holds the arm wherever it is, and the next press goes on
  from there. A short hold, without being disarmed, changes nothing.
- The bound goes to the limiter, the last link before the robot.
"""

from enum import StrEnum

import numpy as np

from ik_client.absolute_clutch import AbsoluteClutch
from ik_client.arm_joints import joints_of
from ik_client.joint_limiter import JointLimiter, MotionLimits
from ik_client.state_machine import ArmState
from ik_client.tick_report import TickReport
from ik_proto import Array

SLOW = 0.5
"""Largest velocity of a joint while an arm goes home or comes [rad/s]."""

THERE = 0.05
"""How near to home every joint is when the arm is there [rad]."""
TOGETHER = 0.15
"""How near to the answer every joint is when the arm is where the operator's is [rad]."""
RISE = 1.0
"""Time in which the bound rises to the full velocity once an arm follows [s]."""


class Stage(StrEnum):
    """How far an arm has come."""

    HOME = "going home, slowly"
    COMING = "coming to your posture, slowly: hold still"
    FOLLOWING = "following"


class Approach:
    """Takes one arm through the stages.

    Attributes:
        stage: Where it is in them; it has meaning while the arm is active.
        pace: Fraction of the full velocity that it may use, above 0 to 1.
    """

    def __init__(self, side: int, slow: float, *, home_first: bool) -> None:
        """Start with an arm that is not operated.

        Args:
            side: 0 for the left arm, 1 for the right one.
            slow: Fraction of the full velocity that is slow, above 0 to 1.
            home_first: Whether it goes home before it comes to the operator.
        """
        self._side = side
        self._slow = slow
        self._begin = Stage.HOME if home_first else Stage.COMING
        self._time: float | None = None
        self.stage = self._begin
        self.pace = slow

    def observe(self, report: TickReport) -> None:
        """Take a tick, and say what the next one may do."""
        dt = 0.0 if self._time is None else max(report.time - self._time, 0.0)
        self._time = report.time
        arm = report.arms[self._side]
        if arm.state not in (ArmState.ACTIVE, ArmState.HOLD):
            self.stage, self.pace = self._begin, self._slow
        elif arm.state is ArmState.ACTIVE:
            gap = self._gap(report)
            if self.stage is Stage.HOME and arm.authority >= 1.0 and gap <= THERE:
                # Home is a place to begin from: it is left for good.
                self.stage = self._begin = Stage.COMING
            elif self.stage is Stage.COMING and arm.authority >= 1.0 and gap <= TOGETHER:
                self.stage = Stage.FOLLOWING
            elif self.stage is Stage.FOLLOWING:
                self.pace = min(1.0, self.pace + dt / RISE)

    def _gap(self, report: TickReport) -> float:
        """How far the farthest joint is from the answer [rad]; infinite without one."""
        if report.reply is None or not report.reply.success or report.reply.sol_q is None:
            return float("inf")
        q = report.command.q
        arm = joints_of(self._side, len(q))
        return float(np.abs(q[arm] - report.reply.sol_q[arm]).max())


class HomeFirst(AbsoluteClutch):
    """The absolute clutch of an arm that goes home first: meanwhile the hand that it follows is at home."""

    def __init__(self, approach: Approach, T_pelvis_home: Array) -> None:
        """Start open.

        Args:
            approach: Of this arm.
            T_pelvis_home: Where the wrist is in the home posture, shape (4, 4) [m].
        """
        super().__init__()
        self._approach = approach
        self._home = T_pelvis_home

    def engage(self, T_hand: Array, T_pelvis_wrist: Array) -> None:
        """Note how far the wrist is from where it goes; see `AbsoluteClutch.engage`."""
        super().engage(self._goal(T_hand), T_pelvis_wrist)

    def follow(self, T_hand: Array, authority: float = 1.0) -> Array:
        """Where the wrist shall be; see `AbsoluteClutch.follow`."""
        return super().follow(self._goal(T_hand), authority)

    def _goal(self, T_hand: Array) -> Array:
        return self._home if self._approach.stage is Stage.HOME else T_hand


class PacedLimiter(JointLimiter):
    """A joint limiter whose velocity limits are those of two approaches."""

    def __init__(
        self,
        n: int,
        period: float,
        limits: MotionLimits,
        approaches: tuple[Approach, Approach],
        *,
        lower: Array,
        upper: Array,
    ) -> None:
        """Set the bounds; see `JointLimiter`.

        Args:
            n: Number of joints, half of them the left arm's.
            period: Time between two commands [s].
            limits: Bounds of the motion of an arm that follows.
            approaches: Of the left and of the right arm.
            lower: Lower joint limits, shape (n,) [rad].
            upper: Upper joint limits, shape (n,) [rad].
        """
        super().__init__(n, period, limits, lower=lower, upper=upper)
        self._approaches = approaches
        self._n = n

    def limit(self, q_last: Array, q_wanted: Array, dt: float | None = None, haste: float | Array = 1.0) -> Array:
        """Move from the last command towards the wanted joints; see `JointLimiter.limit`."""
        pace = np.repeat([approach.pace for approach in self._approaches], self._n // 2)
        return super().limit(q_last, q_wanted, dt, np.minimum(haste, pace))
