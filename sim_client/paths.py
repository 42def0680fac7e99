"""Scripted paths for two wrists, sized to the robot's own arms.

Every path is a smooth function of time that starts at rest, stays within reach and clear of the body, and is the same
for both sides, mirrored. Positions are multiples of the reach, from the shoulder: forward, outward, up. The palms
face each other when the rotation is the identity, as in the zero posture of the G1.
"""

from collections.abc import Callable, Mapping

import numpy as np

from ik_proto import Array
from sim_client.arms import ArmKinematics
from sim_client.poses import rotation_about

_RAMP = 1.0
"""Time in which a path gathers speed [s]."""

_Outline = Callable[[float], tuple[Array, Array]]
"""Phase in seconds to the position (forward, outward, up) [reach] and the rotation vector [rad] of the left wrist."""


def _circles(phase: float) -> tuple[Array, Array]:
    """Both hands draw circles in a plane in front of the chest."""
    angle = 2.0 * np.pi * phase / 5.0
    position = np.array([0.66, 0.25 + 0.20 * np.cos(angle), -0.27 + 0.20 * np.sin(angle)])
    return position, np.array([0.0, -0.25, 0.0])


def _reach(phase: float) -> tuple[Array, Array]:
    """Both hands reach forward and draw back, rising and sinking more slowly."""
    stroke = np.sin(2.0 * np.pi * phase / 3.0 - np.pi / 2.0)
    lift = np.sin(2.0 * np.pi * phase / 7.0)
    return np.array([0.66 + 0.12 * stroke, 0.15, -0.30 + 0.14 * lift]), np.array([0.0, -0.2 - 0.2 * lift, 0.0])


def _wave(phase: float) -> tuple[Array, Array]:
    """Both hands are up beside the head and wave."""
    swing = np.sin(2.0 * np.pi * phase / 1.6)
    return np.array([0.52, 0.28 + 0.10 * swing, 0.28]), np.array([-0.30 * swing, -1.0, 0.0])


PATHS: Mapping[str, _Outline] = {"circles": _circles, "reach": _reach, "wave": _wave}
"""The scripted paths by name."""

DEFAULT_PATH = "circles"


class ScriptedPath:
    """A path of `PATHS` for a robot's arms."""

    def __init__(self, name: str, arms: ArmKinematics) -> None:
        """Size the path.

        Args:
            name: A key of `PATHS`.
            arms: The arms it is for.

        Raises:
            ValueError: There is no such path; one line that lists them.
        """
        if name not in PATHS:
            raise ValueError(f"there is no path {name!r}; there are {', '.join(PATHS)}")
        self._outline = PATHS[name]
        self._shoulders = arms.shoulders
        self._reach = arms.reach

    @property
    def length(self) -> None:
        """A scripted path goes on for ever."""
        return

    def poses(self, time: float) -> tuple[Array, Array]:
        """Wrist poses `T_pelvis_wrist`, left and right, shape (4, 4) each [m], at a time since the beginning [s]."""
        position, rotation = self._outline(_eased(time))
        return self._pose(0, position, rotation), self._pose(1, position * _MIRROR, rotation * _MIRROR_ROTATION)

    def _pose(self, arm: int, position: Array, rotation: Array) -> Array:
        T = np.eye(4)
        T[:3, :3] = rotation_about(rotation)
        T[:3, 3] = self._shoulders[arm] + self._reach[arm] * position
        return T


_MIRROR = np.array([1.0, -1.0, 1.0])
_MIRROR_ROTATION = np.array([-1.0, 1.0, -1.0])


def _eased(time: float) -> float:
    """Time that starts at rest and runs at full speed after the ramp."""
    return time * time / (2.0 * _RAMP) if time < _RAMP else time - _RAMP / 2.0
