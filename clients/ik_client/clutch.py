"""The clutch: a wrist follows how a hand has moved since it was engaged, not where the hand is.

Engaging takes a snapshot of both. From then on

    p_wrist = p_wrist0 + s (p_hand - p_hand0)
    R_wrist = (R_hand R_hand0^T) R_wrist0

in the axes of the frame the hand is given in: positions by a scale s, rotations one to one. In the tick of engagement
the target is where the wrist is, so no grip can make an arm jump.

With an authority below one, each tick applies that fraction of the hand's way and turn since the tick before, and takes
a new snapshot. What was withheld is never caught up, so the wrist is never faster than the hand times the scale. With
full authority the snapshot stays, and nothing drifts.
"""

import math

import numpy as np

from ik_client.rotation import rotation_matrix, rotation_vector
from ik_proto import Array
from ik_proto.pose import as_pose


class Clutch:
    """Maps the motion of one hand to one wrist.

    Attributes:
        scale: Way of the wrist over way of the hand.
    """

    def __init__(self, scale: float = 1.0) -> None:
        """Start open.

        Args:
            scale: Way of the wrist over way of the hand, positive.

        Raises:
            ValueError: The scale is not a positive number.
        """
        if not (math.isfinite(scale) and scale > 0.0):
            raise ValueError(f"the clutch's scale must be a positive number, not {scale}")
        self.scale = scale
        self._hand: Array | None = None
        self._wrist: Array | None = None

    @property
    def engaged(self) -> bool:
        """Whether there is a snapshot to follow from."""
        return self._hand is not None

    def engage(self, T_hand: Array, T_pelvis_wrist: Array) -> None:
        """Take a snapshot.

        Args:
            T_hand: Where the hand is, shape (4, 4) [m].
            T_pelvis_wrist: Where the wrist is commanded to be, shape (4, 4) [m].

        Raises:
            ValueError: One of them is no pose. The snapshot before it stays.
        """
        hand, wrist = as_pose(np.array(T_hand, dtype=np.float64)), as_pose(np.array(T_pelvis_wrist, dtype=np.float64))
        self._hand, self._wrist = hand, wrist

    def release(self) -> None:
        """Forget the snapshot."""
        self._hand = self._wrist = None

    def follow(self, T_hand: Array, authority: float = 1.0) -> Array:
        """Where the wrist shall be.

        Args:
            T_hand: Where the hand is, shape (4, 4) [m].
            authority: Fraction of the hand's motion to follow, 0 to 1.

        Returns:
            Target `T_pelvis_wrist`, shape (4, 4) [m].

        Raises:
            ValueError: The clutch is not engaged, or the authority is not within 0 and 1.
        """
        if self._hand is None or self._wrist is None:
            raise ValueError("the clutch is not engaged: engage it before following")
        if not 0.0 <= authority <= 1.0:
            raise ValueError(f"authority must be within 0 and 1, not {authority}")
        R = T_hand[:3, :3] @ self._hand[:3, :3].T
        if authority < 1.0:
            R = rotation_matrix(authority * rotation_vector(R))
        target = np.eye(4)
        target[:3, :3] = R @ self._wrist[:3, :3]
        target[:3, 3] = self._wrist[:3, 3] + self.scale * authority * (T_hand[:3, 3] - self._hand[:3, 3])
        if authority < 1.0:
            self.engage(T_hand, target)
        return target
