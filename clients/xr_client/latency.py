"""How long one stage takes: percentiles of all samples of a run, in memory that does not grow.

Samples are counted in bins on a logarithmic scale, 1 % wide, from 1 us to 100 s, as histograms of latency are kept
elsewhere (HdrHistogram). So a percentile is right within 1 %, the largest sample and the count are exact.
"""

import math
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_LEAST, _MOST, _WIDTH = 1e-3, 1e5, 0.01
_BINS = math.ceil(math.log(_MOST / _LEAST) / math.log1p(_WIDTH)) + 1
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
        self._bins = np.zeros(_BINS, dtype=np.int64)
        self._max = 0.0
        self._recent: deque[float] = deque(maxlen=_RECENT)
        self._last = -math.inf

    def add(self, ms: float) -> None:
        """Take a sample [ms]. One below zero, where clocks were compared that differ a little, counts as zero."""
        ms = max(ms, 0.0)
        place = 0 if ms <= _LEAST else min(math.ceil(math.log(ms / _LEAST) / math.log1p(_WIDTH)), _BINS - 1)
        with self._lock:
            self._bins[place] += 1
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
            bins, largest = self._bins.copy(), self._max
        counted = np.cumsum(bins)
        n = int(counted[-1])
        if n == 0:
            return None

        def percentile(percent: float) -> float:
            place = int(np.searchsorted(counted, math.ceil(n * percent / 100.0)))
            return min(_LEAST * (1.0 + _WIDTH) ** place, largest)

        return Summary(percentile(50.0), percentile(95.0), percentile(99.0), largest, n)
