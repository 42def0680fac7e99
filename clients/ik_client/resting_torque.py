"""The gravity torque of arms that hold.

The answers that an arm follows tell the torque of where it goes. An arm that brakes comes to rest elsewhere, by up to a
stopping distance, or anywhere on the way to a goal that was far. So when it brakes the service is asked for the torque
of where it will rest, once the tick's command is on its way, and the torque goes there evenly: never by a step.

What is not known changes nothing: without an answer, the torque stays as it was.
"""

import contextlib

import numpy as np

from ik_client.gravity_torque import EVERY, GravityTorque
from ik_client.partners import Partners
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

    def __init__(self, ik: Kinematics, partners: Partners) -> None:
        """Start without an answer.

        Args:
            ik: The service.
            partners: Knows how it does.
        """
        self._service = GravityTorque(ik)
        self._partners = partners
        self._asked, self._due = -np.inf, -np.inf
        self._q = np.full(0, np.nan)
        self._waist: Array | None = None
        self._tau = np.full(0, np.nan)

    def with_held(
        self, held: list[slice], rest: Array, waist: Array | None, tau: Array, tau_last: Array, dt: float
    ) -> Array:
        """A tick's torque, that of arms that hold on its way to the torque of where they rest, if that is known.

        Args:
            held: Joints of the arms that hold.
            rest: Where the joints come to rest, shape (n,) [rad].
            waist: Where the waist stands, shape (w,) [rad]; None where it stays straight.
            tau: What it is otherwise, shape (n,) [N m].
            tau_last: Torque of the last command, shape (n,) [N m].
            dt: Time since then [s].

        Returns:
            The torque, shape (n,) [N m].
        """
        tau, most = tau.copy(), RATE * min(max(dt, 0.0), _LONGEST_GAP)
        for arm in held:
            if self._knows(arm, rest, waist):
                tau[arm] = tau_last[arm] + np.clip(self._tau[arm] - tau_last[arm], -most, most)
        return tau

    def look(self, held: list[slice], rest: Array, waist: Array | None, now: float) -> None:
        """Ask for the torque of arms that hold, where it is not known, it is time to, and the service answers.

        Args:
            held: Joints of the arms that hold.
            rest: Where the joints come to rest, shape (n,) [rad].
            waist: Where the waist stands, shape (w,) [rad]; None where it stays straight.
            now: Time of the tick [s].
        """
        # Written so that a clock that stepped back counts as long ago.
        waits = self._asked <= now < self._due
        if waits or not self._partners.service.answers or all(self._knows(arm, rest, waist) for arm in held):
            return
        self._asked, self._due = now, now + ASK_AGAIN
        # Why the arms hold is told already, and without an answer the torque stays as it was.
        with contextlib.suppress(Exception):
            tau, boot_id = self._service.ask(rest, waist, now)
            self._partners.same_run(boot_id)
            self._due = now + EVERY
            self._q, self._waist, self._tau = rest.copy(), None if waist is None else waist.copy(), np.array(tau)

    def _knows(self, arm: slice, rest: Array, waist: Array | None) -> bool:
        if len(self._q) != len(rest) or (waist is None) is not (self._waist is None):
            return False
        same_waist = waist is None or self._waist is None or _near(waist, self._waist)
        return same_waist and _near(rest[arm], self._q[arm])


def _near(one: Array, other: Array) -> bool:
    return len(one) == len(other) and bool(np.all(np.abs(one - other) <= KNOWN_WITHIN))
