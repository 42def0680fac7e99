"""What is fitted to a person: where the head turns about, and how long the arms are beside the robot's."""

import math
from dataclasses import dataclass

import numpy as np

from ik_proto import Array

G1_REACH = 0.444
"""How far a G1's end-effector gets from its shoulder [m]."""

TYPICAL_NECK = np.array([-0.08, 0.0, -0.12])
"""The neck seen from between the eyes, robot axes, shape (3,) [m]; a guess, kept where a fit says nothing."""
TYPICAL_NECK.flags.writeable = False

_LEAST_TURN = math.radians(10.0)
"""Spread of head rotations (rms) that a fit needs [rad]."""
_OBSERVED = 0.2
"""Smallest singular value, relative to the largest, of a direction that a fit says something about."""


class CalibrationError(ValueError):
    """A person cannot be fitted; its message says what to do differently."""


@dataclass(frozen=True, slots=True, eq=False)
class Neck:
    """The point a head turns about.

    Attributes:
        offset: The point seen from the head, in the head's axes, shape (3,) [m].
        residual: How far the point moved while the head turned, rms [m].
    """

    offset: Array
    residual: float

    def point(self, T_room_head: Array) -> Array:
        """Where the point is in the room, shape (3,) [m]."""
        return T_room_head[:3, 3] + T_room_head[:3, :3] @ self.offset


def fit_neck(T_room_heads: Array) -> Neck:
    """Find the point that stands still while a standing person looks around.

    Linear least squares of p_i + R_i o = c in the offset o and the point c. What the turns do not show, such as the
    height of the point when the head only turned from side to side, stays as `TYPICAL_NECK` has it.

    Args:
        T_room_heads: Poses of the head, shape (N, 4, 4) [m], robot axes.

    Returns:
        The neck.

    Raises:
        CalibrationError: The head did not turn enough.
    """
    R, p = T_room_heads[:, :3, :3], T_room_heads[:, :3, 3]
    A = (R - R.mean(axis=0)).reshape(-1, 3)
    b = -(p - p.mean(axis=0)).reshape(-1) - A @ TYPICAL_NECK
    # |R - mean R|^2 (Frobenius) is 4 (1 - cos a), about 2 a^2, for a turn by a about the mean.
    turned = math.sqrt(0.5 * float((A * A).sum()) / max(len(R), 1))
    if not turned >= _LEAST_TURN:
        raise CalibrationError(
            f"the head turned by {math.degrees(turned):.0f} degrees: look left and right, up and down, and try again"
        )
    correction = np.linalg.lstsq(A, b, rcond=_OBSERVED)[0]
    missed = (A @ correction - b).reshape(-1, 3)
    return Neck(TYPICAL_NECK + correction, math.sqrt(float((missed * missed).sum()) / len(R)))


def arm_scale(arm_length: float, robot_reach: float = G1_REACH) -> float:
    """The clutch's scale with which a person's stretched arm is the robot's stretched arm.

    Args:
        arm_length: From the person's shoulder to the wrist [m].
        robot_reach: From the robot's shoulder to its end-effector, stretched [m].

    Returns:
        Way of the wrist over way of the hand.

    Raises:
        CalibrationError: That is no arm.
    """
    if not 0.2 <= arm_length <= 1.2:
        raise CalibrationError(f"an arm of {arm_length} m? measure from the shoulder to the wrist, in metres")
    return robot_reach / arm_length
