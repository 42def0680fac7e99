"""Where hands come from in the simulator: motions of two wrists, and an operator who grips and moves along them.

The poses of a motion are meant in the pelvis frame: the loop follows them with an `AbsoluteClutch`.
"""

from collections.abc import Callable
from typing import Protocol

from ik_client import (
    ArmEngagement,
    ArmState,
    GateLimits,
    Hands,
    HandSample,
    PoseGate,
)
from ik_proto import Array
from sim_client.poses import interpolate, smooth_step
from sim_client.robot import SimRobot
from sim_client.trace import Tick

APPROACH_TIME = 2.0
"""How long the wrists take to the beginning of a motion [s]."""

REGRIP_TIME = 1.0
"""How long the scripted operator waits before gripping again [s]."""

_INFINITE = float("inf")


class Motion(Protocol):
    """Two wrists moving in time."""

    @property
    def length(self) -> float | None:
        """How long it lasts [s]; None if it goes on for ever."""
        ...

    def poses(self, time: float) -> tuple[Array, Array]:
        """Where the wrists are.

        Args:
            time: Since the beginning [s], not negative.

        Returns:
            `T_pelvis_wrist`, left and right, shape (4, 4) each [m].
        """
        ...


class Approach:
    """Leads the wrists to the beginning of a motion without a jump, then plays it."""

    def __init__(self, motion: Motion, start: tuple[Array, Array], duration: float = APPROACH_TIME) -> None:
        """Prepare.

        Args:
            motion: What to play.
            start: Wrist poses at the beginning, left and right, shape (4, 4) each [m].
            duration: How long the approach takes [s].
        """
        self._motion = motion
        self._start = start
        self._duration = duration

    @property
    def length(self) -> float | None:
        """How long approach and motion last together [s]; None if they go on for ever."""
        return None if self._motion.length is None else self._duration + self._motion.length

    def poses(self, time: float) -> tuple[Array, Array]:
        """Poses at a time since the beginning [s]; the first are the start poses themselves."""
        left, right = self._motion.poses(max(time - self._duration, 0.0))
        if time < self._duration:
            progress = smooth_step(time / self._duration)
            left = interpolate(self._start[0], left, progress)
            right = interpolate(self._start[1], right, progress)
        return left, right


class Markers:
    """The markers in the window, wherever they have been dragged."""

    length = None

    def __init__(self, robot: SimRobot) -> None:
        """Read the markers of this robot's scene."""
        self._robot = robot

    def poses(self, time: float) -> tuple[Array, Array]:  # noqa: ARG002  # they know no time
        """Poses of the markers now."""
        return self._robot.shown_targets()


class ScriptedOperator:
    """An operator made of a motion: grips as soon as the robot is ready, and never lets go by mistake.

    When the arms were disarmed, by a service that was restarted for example, this operator lets go, waits, and grips
    again, as a person would who has looked at the robot first. The motion goes on meanwhile.
    """

    def __init__(self, motion: Motion, ready: Callable[[], bool], *, regrip: float = REGRIP_TIME) -> None:
        """Prepare; the motion begins with the first grip.

        Args:
            motion: What the hands do.
            ready: Whether the robot's end would follow.
            regrip: How long to wait before gripping again [s].
        """
        self._motion = motion
        self._ready = ready
        self._regrip = regrip
        self._begin: float | None = None
        self._grips = False
        self._since: float | None = None

    def hands(self, now: float) -> Hands:
        """What the hands do now."""
        if self._since is None:
            self._since = now - self._regrip  # the first grip waits for nothing but the robot
        elif not self._grips and self._ready() and now - self._since >= self._regrip:
            self._grips = True
            self._begin = now if self._begin is None else self._begin
        left, right = self._motion.poses(0.0 if self._begin is None else now - self._begin)
        return Hands(HandSample(left, self._grips, now), HandSample(right, self._grips, now))

    def observe(self, tick: Tick) -> None:
        """Let go when an arm has been disarmed."""
        if self._grips and any(step.state is ArmState.DISARMED for step in tick.report.arms):
            self._grips, self._since = False, tick.report.time


def scripted_arm() -> ArmEngagement:
    """How a script's hand engages: at its word, wherever it is and however still or fast."""
    limits = GateLimits(max_speed=_INFINITE, max_turn=_INFINITE, freeze_time=_INFINITE)
    return ArmEngagement.absolute(PoseGate(limits))
