"""The gravity torque of where the arms are commanded: what a rate loop sends along, so that they do not sag.

The verb `velocity` says nothing of torques, but `solve` does. So from time to time, and after a tick's command is on
its way, the service is asked where the wrists are and then to solve for just that: its answer is the posture itself,
within a hundredth of a radian, and the torque there. In between the torque stays; in the time between two questions
that of an arm at its largest rate speed changes by less than a newton metre.
"""

import numpy as np

from ik_client.tick import Hold, usable
from ik_client.types import Kinematics
from ik_proto import Array

EVERY = 0.04
"""Time between two questions [s]."""

SAME = 0.05
"""How far the answer may be from the posture that was asked about [rad]."""


class GravityTorque:
    """Asks for the torque, and keeps it.

    Attributes:
        wrists: Wrist poses `T_pelvis_wrist` of the last question, left and right; None before the first answer.
    """

    def __init__(self, ik: Kinematics) -> None:
        """Start without an answer.

        Args:
            ik: The service.
        """
        self.wrists: tuple[Array, Array] | None = None
        self._ik = ik
        self._asked = -np.inf
        self._q = np.full(0, np.nan)

    def due(self, now: float) -> bool:
        """Whether it is time to ask.

        Args:
            now: Time [s], monotonic.
        """
        # Written so that a clock that stepped back counts as long ago.
        return not 0.0 <= now - self._asked < EVERY

    def is_of(self, q: Array) -> bool:
        """Whether the last answer is the torque of this very posture.

        Args:
            q: Joints as commanded, shape (n,) [rad].
        """
        return np.array_equal(q, self._q)

    def ask(self, q: Array, waist: Array | None, now: float) -> tuple[Array, str]:
        """Ask.

        Args:
            q: Joints as commanded, shape (n,) [rad].
            waist: Where the waist stands, shape (w,) [rad]; None where it stays straight.
            now: Time [s], monotonic.

        Returns:
            The torque, shape (n,) [N m], and the run of the service that knows it.

        Raises:
            Hold: The answer is of no use.
            IKError: There is none.
        """
        self._asked = now
        there = self._ik.fk(q, waist)
        self.wrists = there.left_wrist, there.right_wrist
        reply = self._ik.solve(there.left_wrist, there.right_wrist, q, np.zeros(len(q)), waist=waist, collision="off")
        if not reply.success:
            raise Hold(f"{reply.status}: {reply.error}")
        if np.abs(usable(reply.sol_q, len(q), "the answer") - q).max() > SAME:
            raise Hold("the gravity torque is known for another posture only")
        tau = usable(reply.tau, len(q), "the answer's torque")
        self._q = q.copy()
        return tau, reply.boot_id
