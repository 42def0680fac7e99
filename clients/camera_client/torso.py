"""The operator's pelvis frame: origin between the hips, upright, turned with the body.

    level = R_level_camera camera,    R_level_camera = R_tilt M,    M = [[0, 0, -1], [1, 0, 0], [0, -1, 0]]
    pelvis = Rz(-yaw) level

M takes the optical frame of a camera that looks at the operator to the operator's axes: forward is towards the camera
(-z), left is the picture's right (x), up is -y. It is a rotation (determinant +1). R_tilt takes out how the camera is
mounted. The yaw comes from the hips, from the shoulders as far as they are seen, and from the front of the trunk
(`trunk_plane`), and is filtered. A trunk is round: of a turn, its surfaces show a part only.

A shoulder behind its own arm is not seen. Where it should be is known from the trunk, which is rigid, about.

Where the hips are out of view, the origin is as far below the shoulders as it was when they were last seen.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camera_client.landmarks import HIPS, SHOULDERS
from camera_client.vectors import between, transport, unit
from ik_proto import Array

R_FACING_CAMERA = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""M: axes of a person who faces a level camera, from its optical axes."""
R_FACING_CAMERA.flags.writeable = False

_YAW_SIGMA = math.radians(5.0)
"""Standard deviation of the yaw of one frame by one pair of joints [rad]."""
_YAW_DOUBT = math.radians(8.0)
"""Difference to what the hips say at which the yaw by shoulders counts half [rad]."""
SHOWN = 0.85
"""The part of a turn that the surfaces before shoulders and hips show."""
_FRONT_SHOWN = 0.70
"""The part that the front of the trunk shows; a round one less, a flat one more."""
_FRONT_SHARE = 0.5
"""How much it counts."""
_YAW_ACCELERATION = 2.0
"""Standard deviation of the acceleration of an operator's yaw [rad/s^2]."""
_CALM, _AGILE = 0.01, 4.0
"""Factors on its variance while the operator does not turn, and turns as never before."""
_DRIFT_TAU = 0.25
"""Time over which it is judged which of it is the case [s]."""
_LEARN = 1.0
"""Time over which it is learnt how far the hips are below the shoulders [s]."""
_HAND_OVER = 0.3
"""Time over which the origin goes from seen hips to guessed ones and back [s]."""
_UP = np.array([0.0, 0.0, 1.0])
_BOTH = np.ones(2)


@dataclass(frozen=True, slots=True, eq=False)
class BodyFrame:
    """Where the operator's pelvis is.

    Attributes:
        origin: Between the hips, optical frame, shape (3,) [m].
        R_pelvis_camera: Rotation from the optical frame, shape (3, 3).
        yaw: How far the operator is turned to the left [rad].
    """

    origin: Array
    R_pelvis_camera: Array
    yaw: float

    def points(self, p_camera: Array) -> Array:
        """Points of the optical frame in the pelvis frame, shape (..., 3) [m]."""
        return (p_camera - self.origin) @ self.R_pelvis_camera.T

    def directions(self, v_camera: Array) -> Array:
        """Directions or velocities of the optical frame in the pelvis frame, shape (..., 3)."""
        return v_camera @ self.R_pelvis_camera.T


def level_rotation(up_camera: Array) -> Array:
    """R_level_camera of a camera, from the direction that is up in its picture.

    Args:
        up_camera: Up, optical frame, shape (3,), of any length.

    Returns:
        Shape (3, 3): the smallest correction of M that makes up +z. It takes out pitch and roll, and no yaw.
    """
    up = unit(R_FACING_CAMERA @ up_camera)
    tilt = transport(np.eye(3), up, _UP).T
    return tilt @ R_FACING_CAMERA


def facing_yaw(across_level: Array) -> float:
    """How far a body seems turned whose left is there from its right, level frame, shape (3,) [m]; in [rad]."""
    return math.atan2(-across_level[0], across_level[1])


def turned(seeming: float, shown: float = SHOWN) -> float:
    """How far a body is turned of which a part shows: all of it where it faces the camera or shows its back [rad]."""
    return seeming + (1.0 / shown - 1.0) * math.sin(seeming)


class Torso:
    """Follows the pelvis frame through frames."""

    def __init__(self, R_level_camera: Array, hips_below: Array) -> None:
        """Start without having seen anybody.

        Args:
            R_level_camera: See `level_rotation`.
            hips_below: From between the shoulders to between the hips, pelvis frame, shape (3,) [m], as calibrated.
        """
        self._R_level_camera = R_level_camera
        self._below = hips_below.copy()
        self._yaw = _YawFilter()
        self._share: float | None = None
        self._half_width = 0.0
        self._frame: BodyFrame | None = None

    def shoulders(self) -> Array | None:
        """Where the trunk of the last frame has its shoulders, optical frame, shape (2, 3) [m].

        None where the hips were not seen, as only they tell.
        """
        if self._frame is None or not self._share:
            return None
        half = np.array([0.0, self._half_width, 0.0])
        return self._frame.origin + np.stack([half - self._below, -half - self._below]) @ self._frame.R_pelvis_camera

    def update(
        self, joints: Array, known: NDArray[np.bool_], dt: float, sure: Array = _BOTH, front: float = math.nan
    ) -> BodyFrame:
        """Take the joints of a frame.

        Args:
            joints: Tracked joints, optical frame, shape (8, 3) [m].
            known: Which of them are known, shape (8,); both shoulders are.
            dt: Time since the last frame [s].
            sure: How far the shoulders are seen, 0 to 1, shape (2,).
            front: How far the front of the trunk is turned to the left [rad]; NaN where that is not seen.

        Returns:
            The pelvis frame.
        """
        hips_known = bool(known[HIPS].all())
        trust = float(sure.min())
        level = joints @ self._R_level_camera.T
        measured, variance = self._measured_yaw(level, hips_known, trust, front)
        yaw = self._yaw.update(measured, variance, dt)
        c, s = math.cos(yaw), math.sin(yaw)
        R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ self._R_level_camera
        shoulders = between(*joints[SHOULDERS])
        if self._share is None:
            self._share = float(hips_known)
        elif hips_known:
            self._share = min(1.0, self._share + dt / _HAND_OVER)
        else:
            self._share = max(0.0, self._share - dt / _HAND_OVER)
        learnt = trust * (1.0 - math.exp(-dt / _LEARN))
        half_width = 0.5 * float((R @ (joints[SHOULDERS[0]] - joints[SHOULDERS[1]]))[1])
        self._half_width += (learnt if self._half_width else 1.0) * (half_width - self._half_width)
        origin = shoulders + self._below @ R
        if hips_known:
            hips = between(*joints[HIPS])
            self._below += learnt * (R @ (hips - shoulders) - self._below)
            origin = origin + self._share * (hips - origin)
        self._frame = BodyFrame(origin, R, yaw)
        return self._frame

    def _measured_yaw(self, level: Array, hips_known: bool, trust: float, front: float) -> tuple[float, float]:
        """Yaw of a frame and its variance."""
        yaw, variance = turned(facing_yaw(level[SHOULDERS[0]] - level[SHOULDERS[1]])), _YAW_SIGMA**2
        if hips_known:
            by_hips = turned(facing_yaw(level[HIPS[0]] - level[HIPS[1]]))
            off = math.remainder(yaw - by_hips, 2.0 * math.pi)
            weight = trust / (1.0 + (off / _YAW_DOUBT) ** 2)
            yaw, variance = by_hips + weight / (1.0 + weight) * off, variance / (1.0 + weight)
        if math.isfinite(front):
            yaw += _FRONT_SHARE * math.remainder(turned(front, _FRONT_SHOWN) - yaw, 2.0 * math.pi)
        return yaw, variance

    def forget(self) -> None:
        """Somebody else may come."""
        self._yaw = _YawFilter()
        self._share = None
        self._half_width = 0.0
        self._frame = None


class _YawFilter:
    """Constant-velocity Kalman filter of one angle."""

    def __init__(self) -> None:
        self._yaw, self._rate, self._drift = 0.0, 0.0, 0.0
        self._p: tuple[float, float, float] | None = None

    def update(self, measured: float, variance: float, dt: float) -> float:
        if self._p is None:
            self._yaw, self._p = measured, (variance, 0.0, 1.0)
            return self._yaw
        a, b, c = self._p
        y = math.remainder(measured - self._yaw - dt * self._rate, 2.0 * math.pi)
        # Innovations that keep their sign are a turn, and those that do not are noise.
        self._drift += (1.0 - math.exp(-dt / _DRIFT_TAU)) * (y - self._drift)
        agility = min(max((self._drift**2 / (0.25 * variance)) ** 2, _CALM), _AGILE)
        q = agility * (_YAW_ACCELERATION * dt) ** 2
        a, b, c = a + dt * (2.0 * b + dt * c) + 0.25 * q * dt * dt, b + dt * c + 0.5 * q * dt, c + q
        gain, rate_gain = a / (a + variance), b / (a + variance)
        self._yaw = math.remainder(self._yaw + dt * self._rate + gain * y, 2.0 * math.pi)
        self._rate += rate_gain * y
        self._p = (1.0 - gain) * a, (1.0 - gain) * b, c - rate_gain * b
        return self._yaw
