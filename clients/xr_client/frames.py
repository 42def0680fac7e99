"""From OpenXR's axes to the robot's, and from what a headset tracks to what the robot calls a wrist.

    OpenXR and WebXR    x right     y up      z back
    robot               x forward   y left    z up

`to_robot` changes the axes of the room and those of the tracked body together: M = B T B^-1. A wrist joint of WebXR
(-z towards the fingers, y out of the back of the hand) becomes one with x towards the fingers and z out of its back.
Unitree's wrists have x towards the fingers and z towards the thumb, so a quarter turn about x follows: +90 degrees for
a left hand, -90 degrees for a right one (constants of xr_teleoperate's tv_wrapper.py).

A controller's grip has -z along the handle towards the thumb and its origin in the palm. It is tilted and shifted to
the wrist behind it, see `GripOffset`; the seeds took the grip itself for the wrist, which is `SEED_GRIP`.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ik_proto import Array


class Side(IntEnum):
    """Which hand. Everything that comes in pairs is in this order."""

    LEFT = 0
    RIGHT = 1


T_ROBOT_OPENXR = np.array(
    [[0.0, 0.0, -1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
)
"""OpenXR's axes in the robot's: robot x is -z, robot y is -x, robot z is y."""

T_WRIST_UNITREE = (
    np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]),
    np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]),
)
"""Unitree's wrist in the axes of a WebXR wrist that were changed to the robot's; left, right."""

T_ROBOT_OPENXR.flags.writeable = False
for _T in T_WRIST_UNITREE:
    _T.flags.writeable = False


@dataclass(frozen=True, slots=True)
class GripOffset:
    """Where the wrist is, seen from a controller in the hand. The same for both hands, which mirror each other.

    The tilt is what separates the handles of common controllers from their pointing rays, along which a level forearm
    points. Through the clutch it cancels out; the reach matters, because the wrist moves less than the palm when the
    hand turns about it.

    Attributes:
        tilt: Angle from the forearm up to the handle, with the thumb up [rad].
        reach: From the wrist to the palm's centre [m].
    """

    tilt: float = math.radians(45.0)
    reach: float = 0.09

    def transform(self) -> Array:
        """`T_grip_wrist` in the robot's axes, shape (4, 4) [m]."""
        c, s = math.cos(self.tilt), math.sin(self.tilt)
        T = np.array([[c, 0.0, s, 0.0], [0.0, 1.0, 0.0, 0.0], [-s, 0.0, c, 0.0], [0.0, 0.0, 0.0, 1.0]])
        T[:3, 3] = -self.reach * T[:3, 0]
        return T


SEED_GRIP = GripOffset(tilt=0.0, reach=0.0)
"""The seeds' controllers: the grip is the wrist, without any turn."""


def to_robot(T_openxr: Array) -> Array:
    """Change a pose from OpenXR's axes to the robot's, those of the room and those of the body.

    Args:
        T_openxr: Pose of a body in a room, both with OpenXR's axes, shape (4, 4) [m].

    Returns:
        The same pose with the robot's axes, shape (4, 4) [m]. Exact: numbers only change places and signs.
    """
    return T_ROBOT_OPENXR @ T_openxr @ T_ROBOT_OPENXR.T


def to_openxr(T_robot: Array) -> Array:
    """The inverse of `to_robot`, shape (4, 4) [m]."""
    return T_ROBOT_OPENXR.T @ T_robot @ T_ROBOT_OPENXR


def wrist_of_hand(T_openxr_wrist: Array, side: Side) -> Array:
    """The robot's wrist convention for a tracked hand.

    Args:
        T_openxr_wrist: The hand's wrist joint, shape (4, 4) [m].
        side: Which hand.

    Returns:
        The wrist in the room, the robot's axes, shape (4, 4) [m].
    """
    return to_robot(T_openxr_wrist) @ T_WRIST_UNITREE[side]


def hand_of_wrist(T_room_wrist: Array, side: Side) -> Array:
    """The inverse of `wrist_of_hand`: the wrist joint that gives this wrist, shape (4, 4) [m]."""
    return to_openxr(T_room_wrist @ T_WRIST_UNITREE[side].T)


def wrist_of_grip(T_openxr_grip: Array, offset: GripOffset) -> Array:
    """The robot's wrist convention for a controller.

    Args:
        T_openxr_grip: The controller's grip space, shape (4, 4) [m].
        offset: Where the wrist is, seen from the grip.

    Returns:
        The wrist in the room, the robot's axes, shape (4, 4) [m].
    """
    return to_robot(T_openxr_grip) @ offset.transform()


def pose_of(position: Array, quaternion_xyzw: Array) -> Array:
    """A pose from what WebXR calls a rigid transform.

    Args:
        position: Shape (3,) [m].
        quaternion_xyzw: Shape (4,), not zero; it is normalised.

    Returns:
        Shape (4, 4) [m], float64.
    """
    x, y, z, w = (quaternion_xyzw / math.hypot(*quaternion_xyzw.tolist())).tolist()
    T = np.eye(4)
    T[:3, :3] = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    T[:3, 3] = position
    return T


def quaternion_of(R: Array) -> Array:
    """The unit quaternion xyzw of a rotation, with w not negative, shape (4,).

    Read from its largest component, so that no angle divides by a small number (Shepperd, Quaternion from Rotation
    Matrix, J. Guidance and Control 1(3), 1978).
    """
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    # Row k is the quaternion (x, y, z, w) times four times its component k.
    rows = (
        (1.0 + a - e - i, b + d, c + g, h - f),
        (b + d, 1.0 - a + e - i, f + h, c - g),
        (c + g, f + h, 1.0 - a - e + i, d - b),
        (h - f, c - g, d - b, 1.0 + a + e + i),
    )
    q = np.array(max(rows, key=lambda row: math.hypot(*row)))
    return q * (math.copysign(1.0, q[3]) / np.linalg.norm(q))
