"""The operator's pelvis frame: origin between the hips, upright, turned with the body.

    level = R_level_camera camera,    R_level_camera = R_tilt M,    M = [[0, 0, -1], [1, 0, 0], [0, -1, 0]]
    pelvis = Rz(-yaw) level

M takes the optical frame of a camera that looks at the operator to the operator's axes: forward is towards the camera
(-z), left is the picture's right (x), up is -y. It is a rotation (determinant +1). R_tilt takes out how the camera is
mounted. The yaw comes from the shoulders and the hips, weighed by how far they are apart, and is filtered.

Where the hips are out of view, the origin is as far below the shoulders as it was when they were last seen.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camera_client.landmarks import HIPS, SHOULDERS
from camera_client.vectors import transport, unit
from ik_proto import Array

R_FACING_CAMERA = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""M: axes of a person who faces a level camera, from its optical axes."""
R_FACING_CAMERA.flags.writeable = False

_YAW_SIGMA = math.radians(5.0)
"""Standard deviation of the yaw of one frame [rad]."""
_YAW_ACCELERATION = 2.0
"""Standard deviation of the acceleration of an operator's yaw [rad/s^2]."""
_LEARN = 1.0
"""Time over which it is learnt how far the hips are below the shoulders [s]."""
_HAND_OVER = 0.3
"""Time over which the origin goes from seen hips to guessed ones and back [s]."""
_UP = np.array([0.0, 0.0, 1.0])


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


def facing_yaw(joints_level: Array) -> float:
    """Yaw by shoulders and hips, joints in the level frame, shape (8, 3) [m]; hips of NaN are left out. In [rad]."""
    across = joints_level[SHOULDERS[0]] - joints_level[SHOULDERS[1]]
    hips = joints_level[HIPS[0]] - joints_level[HIPS[1]]
    if np.isfinite(hips).all():
        across = across + hips
    return math.atan2(-across[0], across[1])


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

    def update(self, joints: Array, known: NDArray[np.bool_], dt: float) -> BodyFrame:
        """Take the joints of a frame.

        Args:
            joints: Tracked joints, optical frame, shape (8, 3) [m].
            known: Which of them are known, shape (8,); both shoulders are.
            dt: Time since the last frame [s].

        Returns:
            The pelvis frame.
        """
        hips_known = bool(known[HIPS].all())
        level = joints @ self._R_level_camera.T
        if not hips_known:
            level[HIPS] = np.nan
        yaw = self._yaw.update(facing_yaw(level), dt)
        c, s = math.cos(yaw), math.sin(yaw)
        R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ self._R_level_camera
        shoulders = 0.5 * (joints[SHOULDERS[0]] + joints[SHOULDERS[1]])
        if self._share is None:
            self._share = float(hips_known)
        elif hips_known:
            self._share = min(1.0, self._share + dt / _HAND_OVER)
        else:
            self._share = max(0.0, self._share - dt / _HAND_OVER)
        origin = shoulders + self._below @ R
        if hips_known:
            hips = 0.5 * (joints[HIPS[0]] + joints[HIPS[1]])
            self._below += (1.0 - math.exp(-dt / _LEARN)) * (R @ (hips - shoulders) - self._below)
            origin = origin + self._share * (hips - origin)
        return BodyFrame(origin, R, yaw)

    def forget(self) -> None:
        """Somebody else may come."""
        self._yaw = _YawFilter()
        self._share = None


class _YawFilter:
    """Constant-velocity Kalman filter of one angle."""

    def __init__(self) -> None:
        self._yaw, self._rate = 0.0, 0.0
        self._p: tuple[float, float, float] | None = None

    def update(self, measured: float, dt: float) -> float:
        if self._p is None:
            self._yaw, self._p = measured, (_YAW_SIGMA**2, 0.0, 1.0)
            return self._yaw
        a, b, c = self._p
        q = (_YAW_ACCELERATION * dt) ** 2
        a, b, c = a + dt * (2.0 * b + dt * c) + 0.25 * q * dt * dt, b + dt * c + 0.5 * q * dt, c + q
        yaw = self._yaw + dt * self._rate
        y = math.remainder(measured - yaw, 2.0 * math.pi)
        gain, rate_gain = a / (a + _YAW_SIGMA**2), b / (a + _YAW_SIGMA**2)
        self._yaw = math.remainder(yaw + gain * y, 2.0 * math.pi)
        self._rate += rate_gain * y
        self._p = (1.0 - gain) * a, (1.0 - gain) * b, c - rate_gain * b
        return self._yaw
