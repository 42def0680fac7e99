"""The absolute clutch: a wrist goes where the hand is, and is led there softly.

For trackers that give their hands in the pelvis frame and mean them to be taken at their word: scripts, recordings,
markers dragged in a window, OpenWBT's own way of reading a headset. Engaging notes how far the wrist is from the hand;
this offset melts away while the authority rises:

    p_wrist = p_hand + (1 - a) (p_wrist0 - p_hand0)
    R_wrist = exp((1 - a) log(R_wrist0 R_hand0^T)) R_hand

with a from 0 in the tick of engagement to 1 when the authority is full. So the first target is where the wrist is, no
grip can make an arm jump, and the wrist is faster than the hand only by the offset over the time of the rise.

It goes with an `Authority` that falls at once, so that every engagement starts from nothing: `ArmEngagement.absolute`.
"""

import numpy as np

from ik_client.rotation import rotation_matrix, rotation_vector
from ik_proto import Array
from ik_proto.pose import as_pose

ABSOLUTE_FALL = 1e-6
"""Time in which the authority falls where this clutch is used [s]: within any tick."""


class AbsoluteClutch:
    """Maps the pose of one hand to one wrist."""

    def __init__(self) -> None:
        """Start open."""
        self._turn: Array | None = None
        self._way = np.zeros(3)
        self._begin: float | None = None

    @property
    def engaged(self) -> bool:
        """Whether there is an offset to melt."""
        return self._turn is not None

    def engage(self, T_hand: Array, T_pelvis_wrist: Array) -> None:
        """Note how far the wrist is from the hand.

        Args:
            T_hand: Where the hand is in the pelvis frame, shape (4, 4) [m].
            T_pelvis_wrist: Where the wrist is commanded to be, shape (4, 4) [m].

        Raises:
            ValueError: One of them is no pose. What was noted before stays.
        """
        hand, wrist = as_pose(np.array(T_hand, dtype=np.float64)), as_pose(np.array(T_pelvis_wrist, dtype=np.float64))
        self._turn = rotation_vector(wrist[:3, :3] @ hand[:3, :3].T)
        self._way = wrist[:3, 3] - hand[:3, 3]
        self._begin = None

    def release(self) -> None:
        """Forget the offset."""
        self._turn = None

    def follow(self, T_hand: Array, authority: float = 1.0) -> Array:
        """Where the wrist shall be.

        Args:
            T_hand: Where the hand is in the pelvis frame, shape (4, 4) [m].
            authority: How far the rise has come, 0 to 1; that of the first call counts as none.

        Returns:
            Target `T_pelvis_wrist`, shape (4, 4) [m].

        Raises:
            ValueError: The clutch is not engaged, or the authority is not within 0 and 1.
        """
        if self._turn is None:
            raise ValueError("the clutch is not engaged: engage it before following")
        if not 0.0 <= authority <= 1.0:
            raise ValueError(f"authority must be within 0 and 1, not {authority}")
        if self._begin is None:
            self._begin = authority
        rise = 1.0 - self._begin
        left = (1.0 - authority) / rise if rise > 0.0 else 0.0
        target = np.array(T_hand, dtype=np.float64)
        if left > 0.0:
            target[:3, :3] = rotation_matrix(left * self._turn) @ target[:3, :3]
            target[:3, 3] += left * self._way
        return target
