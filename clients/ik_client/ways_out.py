"""The way out for an arm that is caught: its target is within reach, and not from here.

A tracking solve goes downhill from where the arm is. Once in a while that ends far from a target that another posture
reaches, as beside the singular shoulder of an arm that was stretched out to the side. The arm would stay there until
the hand happens to lead it back. So where an arm stands far off for a while, the whole range of its joints is searched
for a posture that reaches its target. The arm goes there slowly, as nobody expects it to move, straight in its joints,
and checked like every other step. Meanwhile solves start from that posture, so it follows the hand.

Searches come after a tick's command is on its way, one in a while. What finds nothing changes nothing.
"""

import contextlib
from collections.abc import Callable, Sequence

import numpy as np

from ik_client.arm_joints import joints_of
from ik_client.partners import Partners
from ik_proto import Array, SolveReply, Status

FAR = 0.05
"""How far a wrist is from its target that may be caught [m]."""

STANDS = 0.1
"""How far the joints of an arm are from its answer that stands, at most [rad]; beyond, it is still on its way."""

ARRIVED = 0.3
"""How near to where it goes every joint is from where on the arm needs no help [rad]."""

PATIENCE = 0.5
"""How long an arm stands far off before there is a search [s]."""

EVERY = 1.0
"""Time from one search to the next [s]."""

STARTS = 16
"""Starts of a search. One that finds nothing takes the service about a millisecond."""

AHEAD = 0.02
"""How far ahead of the command the goal of an arm on its way out is [rad]: at 50 Hz it moves at 1 rad/s at most."""


class WaysOut:
    """Watches both arms, and knows the postures to which those that were caught go."""

    def __init__(self, partners: Partners) -> None:
        """Start with free arms.

        Args:
            partners: Knows which run of the service is followed.
        """
        self._partners = partners
        self._postures: list[Array | None] = [None, None]
        self._since: list[float | None] = [None, None]
        self._due = -np.inf

    @property
    def under_way(self) -> bool:
        """Whether an arm is on its way out."""
        return any(posture is not None for posture in self._postures)

    def forget(self) -> None:
        """Take both arms for free: none has a target."""
        self._postures[:] = self._since[:] = [None, None]

    def start(self, q: Array) -> Array:
        """Where a solve starts.

        Args:
            q: Where it would start, shape (n,) [rad].

        Returns:
            The same, but for arms on their way out the posture that they go to.
        """
        q = q.copy()
        for side, posture in enumerate(self._postures):
            if posture is not None:
                q[joints_of(side, len(q))] = posture
        return q

    def answered(self, reply: SolveReply, targets: Sequence[Array | None], q_last: Array, now: float) -> None:
        """Take an answer that can be followed.

        Args:
            reply: The answer.
            targets: Of both arms; None for one that has none.
            q_last: The last command, shape (n,) [rad].
            now: Time of the tick [s].
        """
        for side, target in enumerate(targets):
            if target is None or reply.sol_q is None or reply.position_error is None:
                self._postures[side] = self._since[side] = None
                continue
            arm = joints_of(side, len(q_last))
            far = float(reply.position_error[side]) > FAR
            way = float(np.abs(reply.sol_q[arm] - q_last[arm]).max())
            if self._postures[side] is not None:
                self._postures[side] = None if far or way <= ARRIVED else reply.sol_q[arm].copy()
            since = self._since[side]
            stands = far and way <= STANDS and reply.status is Status.UNREACHABLE
            self._since[side] = (now if since is None else since) if stands else None

    def slowed(self, q_last: Array, goal: Array, tau_last: Array, tau: Array) -> tuple[Array, Array]:
        """Bring the goals of arms on their way out near.

        Args:
            q_last: Last command, shape (n,) [rad].
            goal: Where the joints shall go, shape (n,) [rad].
            tau_last: Torque of the last command, shape (n,) [N m].
            tau: Torque at the goal, shape (n,) [N m].

        Returns:
            A goal on the straight way there, and the share of the torque's way that belongs to it.
        """
        goal, tau = goal.copy(), tau.copy()
        for side, posture in enumerate(self._postures):
            if posture is None:
                continue
            arm = joints_of(side, len(goal))
            way = goal[arm] - q_last[arm]
            share = AHEAD / max(float(np.abs(way).max()), AHEAD)
            goal[arm] = q_last[arm] + share * way
            tau[arm] = tau_last[arm] + share * (tau[arm] - tau_last[arm])
        return goal, tau

    def look(self, search: Callable[[], SolveReply], now: float) -> None:
        """Search, if an arm has been caught for a while.

        Args:
            search: Asks the service for a posture from which on the targets of the last answer are reached.
            now: Time of the tick [s].
        """
        caught = [since is not None and now - since >= PATIENCE for since in self._since]
        if not any(caught) or now < self._due:
            return
        self._due = now + EVERY
        with contextlib.suppress(Exception):  # A service in trouble is the next tick's matter.
            reply = search()
            self._partners.same_run(reply.boot_id)
            self._found(reply, caught)

    def _found(self, reply: SolveReply, caught: Sequence[bool]) -> None:
        if not reply.success or reply.sol_q is None or reply.position_error is None:
            return
        for side, is_caught in enumerate(caught):
            if is_caught and reply.position_error[side] <= FAR:
                self._postures[side] = reply.sol_q[joints_of(side, len(reply.sol_q))].copy()
