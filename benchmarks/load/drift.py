"""Does a series of numbers drift, or does it only scatter?

The slope is Theil and Sen's, the median of the slopes of all pairs, with the confidence interval that Kendall's test
gives it (P. K. Sen, Journal of the American Statistical Association 63, 1968). One window in which the machine was busy
elsewhere moves neither.
"""

import math
from dataclasses import dataclass

import numpy as np

from ik_proto import Array

_Z95 = 1.959963984540054
_MAD_TO_DEVIATION = 1.482602218505602
"""Standard deviation over median absolute deviation, of a normal distribution."""


@dataclass(frozen=True, slots=True)
class Drift:
    """How a series changes with time.

    Attributes:
        slope: Units per second.
        low: Lower end of the slope's 95 % confidence interval.
        high: Upper end.
        change: What the slope makes of the whole series [units].
        noise: Spread of the values around the trend, as a standard deviation [units].
    """

    slope: float
    low: float
    high: float
    change: float
    noise: float

    @property
    def beyond_noise(self) -> bool:
        """Whether the series rises for certain, and by more than what lies between one window and the next."""
        return self.low > 0.0 and self.change > self.noise


def drift(times: Array, values: Array) -> Drift:
    """Find the trend of a series.

    Args:
        times: When, shape (n,) [s], different from one another; n at least 2.
        values: What, shape (n,).

    Returns:
        The trend.

    Raises:
        ValueError: There are fewer than two values.
    """
    n = len(values)
    if n < 2:
        raise ValueError(f"a trend takes two values or more, not {n}")
    first, second = np.triu_indices(n, 1)
    slopes = np.sort((values[second] - values[first]) / (times[second] - times[first]))
    slope = float(np.median(slopes))
    half = _Z95 * math.sqrt(n * (n - 1) * (2 * n + 5) / 18.0)
    low, high = (len(slopes) - half) / 2.0, (len(slopes) + half) / 2.0
    trend = slope * (times - times[0])
    residuals = values - trend
    return Drift(
        slope=slope,
        low=float(slopes[round(low) - 1]) if round(low) >= 1 else -math.inf,
        high=float(slopes[round(high)]) if round(high) < len(slopes) else math.inf,
        change=slope * float(np.ptp(times)),
        noise=_MAD_TO_DEVIATION * float(np.median(np.abs(residuals - np.median(residuals)))),
    )
