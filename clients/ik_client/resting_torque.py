"""The gravity torque of arms that hold.

The answers that an arm follows tell the torque of where it goes. An arm that brakes comes to rest elsewhere, by up to a
stopping distance, or anywhere on the way to a goal that was far. So when it brakes the service is asked for the torque
of where it will rest, once the tick's command is on its way, and the torque goes there evenly: never by a step.

What is not known changes nothing: without an answer, the torque stays as it was.
"""

import numpy as np

from ik_client.gravity_torque import EVERY, GravityTorque
from ik_client.types import Kinematics
from ik_proto import Array

RATE = 40.0
"""Largest change of a joint's torque while its arm holds [N m/s]: as much as an outstretched arm of the G1 needs
that moves at 3 rad/s."""

KNOWN_WITHIN = 0.005
"""How far a joint of arm or waist may be from where the torque was asked for [rad]; it changes by 0.1 N m at most."""

ASK_AGAIN = 0.25
"""Time after a question that was not answered to the next [s]."""

_LONGEST_GAP = 0.05
"""Time since the last command that counts, at most [s]."""


class RestingTorque:
    """Knows the torque of the posture that was asked about last."""

    def __init__(self, ik: Kinematics) -> None:
        """Start without an answer.

        Args:
            ik: The service.
        """
        self._service = GravityTorque(ik, every=0.0)
        self._due = -np.inf
        self._asked = -np.inf
        self._q = np.full(0, np.nan)
        self._waist: Array | None = None
        self._tau = np.full(0, np.nan)

    def knows(self, q: Array, waist: Array | None, arm: slice) -> bool:
        """Whether the torque of an arm is known.

        Args:
            q: Where the joints come to rest, shape (n,) [rad].
            waist: Where the waist stands, shape (w,) [rad]; None where it stays straight.
            arm: Its joints.
        """
        if len(self._q) != len(q) or (waist is None) is not (self._waist is None):
            return False
        near = _near(q[arm], self._q[arm])
        return near and (waist is None or self._waist is None or _near(waist, self._waist))

    def towards(self, tau: Array, dt: float, arm: slice) -> Array:
        """The torque of an arm a tick later, on its way to what is known.

        Args:
            tau: Torque of the last command, shape (n,) [N m].
            dt: Time since then [s].
            arm: Its joints.

        Returns:
            The arm's torque, shape (k,) [N m].
        """
        most = RATE * min(max(dt, 0.0), _LONGEST_GAP)
        return tau[arm] + np.clip(self._tau[arm] - tau[arm], -most, most)

    def due(self, now: float) -> bool:
        """Whether it is time to ask.

        Args:
            now: Time [s], monotonic.
        """
        # Written so that a clock that stepped back counts as long ago.
        return not self._asked <= now < self._due

    def ask(self, q: Array, waist: Array | None, now: float) -> str:
        """Ask.

        Args:
            q: Where the joints come to rest, shape (n,) [rad].
            waist: Where the waist stands, shape (w,) [rad]; None where it stays straight.
            now: Time [s], monotonic.

        Returns:
            The run of the service that answered.

        Raises:
            Hold: The answer is of no use.
            IKError: There is none.
        """
        self._asked, self._due = now, now + ASK_AGAIN
        tau, boot_id = self._service.ask(q, waist, now)
        self._due = now + EVERY
        self._q, self._waist, self._tau = q.copy(), None if waist is None else waist.copy(), np.array(tau)
        return boot_id


def _near(one: Array, other: Array) -> bool:
    return len(one) == len(other) and bool(np.all(np.abs(one - other) <= KNOWN_WITHIN))
