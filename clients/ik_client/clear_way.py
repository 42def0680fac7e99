"""The way to an answer, checked behind the limiter: no step from which the arms could not stop clear of the body.

A solver's answer is clear, and so is the straight way to it. But an arm has momentum, and a limiter moves each joint in
its own time: between two clear answers a command may be led where neither is. So before a step is taken, the step and
the way on which the arms would brake from it are measured. Where these come nearer to the body than `KEPT`, slower
steps are tried, on which the joints keep to the straight way, down to braking; and braking from the step before has
been found clear already.

Arms that are nearer already, for whatever reason, may move as long as they come no nearer.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from ik_client.joint_limiter import JointLimiter, Saved
from ik_proto import Array

KEPT = 0.005
"""Clearance that every command keeps, and every stop from it [m]: half of the margin that the G1's answers keep, so
that the limiter has a little room of its own."""

_SLOWER = (0.5, 0.25, 0.1, 0.04)
_LEAST_SHARE = 1e-3
_ROUNDING = 1e-9
"""How much nearer still counts as no nearer [m]."""


class ClearWay:
    """Chooses the fastest of a few steps that is safe. One per loop, around its limiter."""

    def __init__(self, limiter: JointLimiter, clearance: Callable[[Array, Array | None], Array]) -> None:
        """Take the limiter and what measures.

        Args:
            limiter: Bounds the motion.
            clearance: Gives the smallest distance between two parts of the body, shape (k,) [m], for joints of shape
                (k, n) [rad] and the measured waist; raises where it cannot tell.
        """
        self._limiter = limiter
        self._clearance = clearance
        self._haste = 1.0

    def step(self, q_last: Array, q_wanted: Array, dt: float | None, waist: Array | None) -> Array:
        """Move from the last command towards the wanted joints.

        Args:
            q_last: Last command, shape (n,) [rad].
            q_wanted: Where to go, shape (n,) [rad]; a joint without a finite goal comes to rest.
            dt: Time since the last command [s]; None for an ordinary tick.
            waist: Measured waist joints, shape (w,) [rad].

        Returns:
            The next command, shape (n,) [rad].

        Raises:
            Exception: The clearance cannot be told. The limiter is as it was before.
        """
        share, haste = _shares(q_last, q_wanted), min(1.0, 2.0 * self._haste)
        limit = partial(self._limiter.limit, q_last, dt=dt)
        tries = [partial(limit, q_wanted, haste=haste)]
        tries += [partial(limit, q_wanted, haste=slower * haste * share) for slower in _SLOWER]
        tries.append(partial(limit, np.full(len(q_last), np.nan)))
        return self._first_safe(q_last, tries, haste, waist)

    def move(self, q_last: Array, velocity: Array, dt: float | None, waist: Array | None) -> Array:
        """Move from the last command at wanted velocities; where that is not safe, slower in the same direction.

        Args:
            q_last: Last command, shape (n,) [rad].
            velocity: How the joints shall move, shape (n,) [rad/s].
            dt: Time since the last command [s]; None for an ordinary tick.
            waist: Measured waist joints, shape (w,) [rad].

        Returns:
            The next command, shape (n,) [rad].

        Raises:
            Exception: The clearance cannot be told. The limiter is as it was before.
        """
        haste = min(1.0, 2.0 * self._haste)
        paces = [haste, *(slower * haste for slower in _SLOWER), 0.0]
        tries = [partial(self._limiter.move, q_last, pace * velocity, dt) for pace in paces]
        return self._first_safe(q_last, tries, haste, waist)

    def _first_safe(
        self, q_last: Array, steps: Sequence[Callable[[], Array]], haste: float, waist: Array | None
    ) -> Array:
        """Take the first step that is safe, else the one that keeps the largest distance; learn what haste is."""
        before = self._limiter.save()
        try:
            return self._choose(before, q_last, steps, haste, waist)
        except Exception:
            self._limiter.restore(before)
            raise

    def _choose(
        self,
        before: Saved,
        q_last: Array,
        steps: Sequence[Callable[[], Array]],
        haste: float,
        waist: Array | None,
    ) -> Array:
        fastest, *slower = steps
        q = fastest()
        now, nearest = self._nearest(q_last, [(q, self._limiter.stop_path())], waist)
        if _safe(nearest[0], now):
            self._haste = haste
            return q
        ways = []
        for step in slower:
            self._limiter.restore(before)
            ways.append((step(), self._limiter.stop_path()))
        now, nearest = self._nearest(q_last, ways, waist)
        chosen = next((i for i, way in enumerate(nearest) if _safe(way, now)), int(np.argmax(nearest)))
        self._haste = max(haste * _SLOWER[min(chosen, len(_SLOWER) - 1)], _SLOWER[-1])
        self._limiter.restore(before)
        return slower[chosen]()

    def _nearest(
        self, q_last: Array, ways: list[tuple[Array, Array]], waist: Array | None
    ) -> tuple[float, list[float]]:
        """The clearance of the last command, and the smallest of each way [m]."""
        parts = [q_last[None], *(np.vstack([q, stops]) for q, stops in ways)]
        measured = self._clearance(np.concatenate(parts), waist)
        now, *nearest = np.split(measured, np.cumsum([len(part) for part in parts])[:-1])
        return float(now[0]), [float(way.min()) for way in nearest]


def _shares(q_last: Array, q_wanted: Array) -> Array:
    """How fast each joint goes against the one with the longest way, so that all arrive together, above 0 to 1."""
    way = np.nan_to_num(np.abs(q_wanted - q_last), nan=0.0, posinf=0.0)
    return np.clip(way / max(float(way.max()), 1e-9), _LEAST_SHARE, 1.0)


def _safe(nearest: float, now: float) -> bool:
    return nearest >= (KEPT if now >= KEPT else now - _ROUNDING)
