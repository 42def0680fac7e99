"""Where both wrists are when the arms have come to rest: what a snapshot is taken of, and the target of a held arm."""

from collections.abc import Callable

import numpy as np

from ik_proto import Array, FkReply


class RestingWrists:
    """Asks the service for wrist poses, and asks again only once the joints are others."""

    def __init__(self, fk: Callable[[Array, Array | None], FkReply]) -> None:
        """Start without poses.

        Args:
            fk: Forward kinematics of arm joints and waist; raises where it cannot tell.
        """
        self._fk = fk
        self._q = np.full(0, np.nan)
        self._waist: Array | None = None
        self._poses: tuple[Array, Array] | None = None

    def at(self, q: Array, waist: Array | None) -> tuple[Array, Array]:
        """Both wrists at some joints.

        Args:
            q: Arm joints, shape (n,) [rad].
            waist: Measured waist joints, shape (w,) [rad]. They are measured anew every tick and never stand quite
                still: poses are asked for again when one has turned by more than a milliradian.

        Returns:
            `T_pelvis_wrist`, left and right, shape (4, 4) each [m].

        Raises:
            Exception: The service does not answer.
        """
        if self._poses is None or not np.array_equal(q, self._q) or not _near(waist, self._waist):
            reply = self._fk(q, waist)
            self._poses = reply.left_wrist, reply.right_wrist
            self._q, self._waist = q.copy(), None if waist is None else waist.copy()
        return self._poses


def _near(waist: Array | None, other: Array | None) -> bool:
    if waist is None or other is None:
        return waist is other
    return len(waist) == len(other) and bool(np.all(np.abs(waist - other) <= 1e-3))
