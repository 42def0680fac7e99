"""The seeds' weighted moving filter over joint vectors.

An option, not a recommendation: it delays by one sample on average and blends across a solution flip. It is here
because OpenWBT's server applies it to every answer, and because a loop may want it in front of its limiter.
"""

from collections import deque

import numpy as np

from ik_proto.messages import Array

OPENWBT_WEIGHTS = (0.4, 0.3, 0.2, 0.1)
"""Weights of the newest sample first; OpenWBT's `WeightedMovingFilter([0.4, 0.3, 0.2, 0.1], 14)`."""


class WeightedMovingFilter:
    """Weighted mean of the last samples.

    Until as many samples as weights have come, samples pass unchanged. A sample equal to the one before it is not
    counted again: both rules are the seeds'.
    """

    def __init__(self, weights: tuple[float, ...] = OPENWBT_WEIGHTS) -> None:
        """Start without samples.

        Args:
            weights: Weight of each sample, newest first; they add up to one.

        Raises:
            ValueError: The weights do not add up to one.
        """
        if not np.isclose(sum(weights), 1.0):
            raise ValueError(f"weights add up to {sum(weights):g}, not to 1")
        self._weights = np.array(weights)
        self._samples: deque[Array] = deque(maxlen=len(weights))

    def __call__(self, q: Array) -> Array:
        """Take a sample and give the filtered value.

        Args:
            q: Joint positions, shape (n,) [rad].

        Returns:
            Filtered joint positions, shape (n,) [rad].
        """
        if not self._samples or not np.array_equal(q, self._samples[0]):
            self._samples.appendleft(np.array(q))
        if len(self._samples) < len(self._weights):
            return self._samples[0].copy()
        return self._weights @ np.stack(self._samples)

    def reset(self) -> None:
        """Forget all samples."""
        self._samples.clear()
