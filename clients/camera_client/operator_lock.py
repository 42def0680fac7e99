"""Keeps to the operator it began with, so that a passer-by does not take over.

A pose model follows whoever it finds, and may jump from one person to another between two frames. A body counts as the
operator's when it is no further from where the operator was last seen than a person walks in the meantime. Somebody who
was away comes back to about the same place, or the lock is released by hand.
"""

import math

from ik_proto import Array

SPEED = 2.0
"""A walking operator, with some haste [m/s]."""
MARGIN = 0.25
"""How much further the middle of a body may seem to move between two frames [m]."""
FARTHEST = 0.8
"""However long the operator was away, this is too far [m]."""


class OperatorLock:
    """Decides whose body this is.

    Attributes:
        refused: Bodies that were somebody else's, since the last release.
    """

    def __init__(self) -> None:
        """Start unlocked."""
        self.refused = 0
        self._place: Array | None = None
        self._time = -math.inf

    @property
    def locked(self) -> bool:
        """Whether there is an operator."""
        return self._place is not None

    def admit(self, place: Array, now: float) -> bool:
        """Say whether a body is the operator's; the first one is.

        Args:
            place: The middle of the torso, optical frame, shape (3,) [m].
            now: Time of the capture [s].
        """
        if self._place is not None:
            bound = min(MARGIN + SPEED * max(now - self._time, 0.0), FARTHEST)
            if math.dist(place, self._place) > bound:
                self.refused += 1
                return False
        self._place, self._time = place.copy(), now
        return True

    def release(self) -> None:
        """The next body is the operator."""
        self._place = None
        self.refused = 0
