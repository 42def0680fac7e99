"""How long one stage takes: percentiles of all samples of a run, in memory that does not grow (HdrHistogram)."""

import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from hdrh.histogram import HdrHistogram

_HIGHEST_US, _DIGITS = 100_000_000, 3
"""Longest time that can be told from a longer one [us], and the digits that are right."""
_RECENT, _FRESH = 32, 2.0
"""How many samples the display averages over, and how old the last of them may be [s]."""


@dataclass(frozen=True, slots=True)
class Summary:
    """What a stage took.

    Attributes:
        p50: Median [ms].
        p95: 95th percentile [ms].
        p99: 99th percentile [ms].
        max: Largest sample [ms].
        n: Number of samples.
    """

    p50: float
    p95: float
    p99: float
    max: float
    n: int


class Latency:
    """The samples of one stage. One thread may add while others look."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start without a sample.

        Args:
            clock: Monotonic time [s].
        """
        self._clock = clock
        self._lock = threading.Lock()
        self._histogram = HdrHistogram(1, _HIGHEST_US, _DIGITS)
        self._max = 0.0
        self._recent: deque[float] = deque(maxlen=_RECENT)
        self._last = -math.inf

    def add(self, ms: float) -> None:
        """Take a sample [ms]. One below zero, where clocks were compared that differ a little, counts as zero."""
        ms = max(ms, 0.0)
        with self._lock:
            self._histogram.record_value(min(max(math.ceil(1e3 * ms), 1), _HIGHEST_US))
            self._max = max(self._max, ms)
            self._recent.append(ms)
            self._last = self._clock()

    @property
    def recent_ms(self) -> float | None:
        """Median of the latest samples [ms]; None where there were none of late."""
        with self._lock:
            fresh = self._clock() - self._last <= _FRESH
            return statistics.median(self._recent) if fresh else None

    def summary(self) -> Summary | None:
        """All samples so far; None where there were none."""
        with self._lock:
            n, largest = self._histogram.get_total_count(), self._max
            if n == 0:
                return None
            p50, p95, p99 = (1e-3 * self._histogram.get_value_at_percentile(percent) for percent in (50, 95, 99))
        return Summary(min(p50, largest), min(p95, largest), min(p99, largest), largest, n)
