"""Where targets come from: anything that gives two wrist poses for a time, wrapped so that it starts at the robot.

`Approach` serves scripts and recordings: it leads the wrists from where they are to the beginning of the motion, then
plays it. `MarkerSource` makes targets of what a person drags in the window.
"""

from typing import Protocol

from ik_client import WristTargets
from ik_proto import Array
from sim_client.poses import interpolate, smooth_step
from sim_client.robot import SimRobot

APPROACH_TIME = 2.0
"""How long the wrists take to the beginning of a motion [s]."""


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
        """Prepare; time begins with the first tick.

        Args:
            motion: What to play.
            start: Wrist poses at the first tick, left and right, shape (4, 4) each [m].
            duration: How long the approach takes [s].
        """
        self._motion = motion
        self._start = start
        self._duration = duration
        self._begin: float | None = None

    @property
    def length(self) -> float | None:
        """How long approach and motion last together [s]; None if they go on for ever."""
        return None if self._motion.length is None else self._duration + self._motion.length

    def targets(self, now: float) -> WristTargets:
        """Targets for a time; the first are the start poses themselves."""
        if self._begin is None:
            self._begin = now
        elapsed = now - self._begin
        left, right = self._motion.poses(max(elapsed - self._duration, 0.0))
        if elapsed < self._duration:
            progress = smooth_step(elapsed / self._duration)
            left = interpolate(self._start[0], left, progress)
            right = interpolate(self._start[1], right, progress)
        return WristTargets(left, right, now)


class MarkerSource:
    """Targets are the markers in the window, wherever they have been dragged."""

    def __init__(self, robot: SimRobot) -> None:
        """Read the markers of this robot's scene."""
        self._robot = robot

    def targets(self, now: float) -> WristTargets:
        """Poses of the markers now."""
        return WristTargets(*self._robot.shown_targets(), now)
