"""How fast a goal moves, from where it has been lately.

Trackers sample more slowly than a loop ticks, so goals come in steps: the speed is taken over a window, not from tick
to tick. A goal that turned back, leapt, or has no past counts as standing still. One that is faster than a joint may
be is taken as just as fast.
"""

from collections import deque

import numpy as np

from ik_proto import Array

WINDOW = 0.03
"""Time over which the speed is taken, at least two ticks [s]."""


class MovingGoal:
    """Remembers the goals of a few ticks."""

    def __init__(self, period: float, fastest: Array) -> None:
        """Start without a past.

        Args:
            period: Time between two ticks [s].
            fastest: The largest speed to give, shape (n,) [rad/s]. At twice of it a goal leaps rather than moves.
        """
        self._period = period
        self._fastest = fastest
        self._goals: deque[Array] = deque(maxlen=1 + max(2, round(WINDOW / period)))

    @property
    def past(self) -> tuple[Array, ...]:
        """The goals remembered, oldest first."""
        return tuple(self._goals)

    @past.setter
    def past(self, goals: tuple[Array, ...]) -> None:
        self._goals.clear()
        self._goals.extend(goals)

    def forget(self) -> None:
        """Begin anew."""
        self._goals.clear()

    def speed(self, goal: Array) -> Array:
        """Take this tick's goal.

        Args:
            goal: Where to go, shape (n,) [rad]; NaN where there is none.

        Returns:
            How fast it moves, shape (n,) [rad/s].
        """
        self._goals.append(goal)
        span = len(self._goals) - 1
        if not span:
            return np.zeros(len(goal))
        speed = (goal - self._goals[0]) / (span * self._period)
        turned = np.sign(goal - self._goals[-2]) * np.sign(speed) < 0.0
        # Comparisons with NaN are false: a joint that had no goal lately has none that moves.
        moves = (np.abs(speed) < 2.0 * self._fastest) & ~turned
        return np.where(moves, np.clip(speed, -self._fastest, self._fastest), 0.0)
