"""How fast a goal moves, from where it has been lately.

Trackers sample more slowly than a loop ticks, so goals come in steps: the speed is taken over a window, not from tick
to tick. A goal that turned back, leapt, or has no past counts as standing still.
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
            fastest: Beyond this a goal leaps rather than moves, shape (n,) [rad/s].
        """
        self._period = period
        self._fastest = fastest
        self._goals: deque[Array] = deque(maxlen=1 + max(2, round(WINDOW / period)))

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
        return np.where((np.abs(speed) < self._fastest) & ~turned, speed, 0.0)
