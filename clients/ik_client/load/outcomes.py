"""What the requests of a load run led to.

- `latency` runs from the instant a request was due, so a service that freezes is charged for every request that had to
  wait, not only for the one it froze on. `round_trip` runs from the instant it was sent.
- A timeout counts in both, at the time it took: leaving it out would hide the worst. A request still unsent when the
  run is over counts in `latency` at the age it had reached.
- Other errors count only as errors: a refused connection is quick, and no latency.
"""

from collections import Counter

from hdrh.histogram import HdrHistogram

_LOWEST_NS, _HIGHEST_NS, _DIGITS = 1, 600 * 10**9, 3
PERCENTILES = (50.0, 90.0, 99.0, 99.9)


class Durations:
    """A histogram of durations, from 1 ns to 600 s with three digits."""

    def __init__(self) -> None:
        """Start empty."""
        self._histogram = HdrHistogram(_LOWEST_NS, _HIGHEST_NS, _DIGITS)

    def record(self, seconds: float) -> None:
        """Count a duration [s]; one out of range counts as the nearest in it."""
        self._histogram.record_value(min(max(int(seconds * 1e9), _LOWEST_NS), _HIGHEST_NS))

    def add(self, other: "Durations") -> None:
        """Count all of another's durations."""
        self._histogram.add(other._histogram)

    @property
    def count(self) -> int:
        """How many were recorded."""
        return self._histogram.get_total_count()

    def percentile(self, percent: float) -> float:
        """The duration that so many percent do not exceed [s]; 0 where there is none."""
        return self._histogram.get_value_at_percentile(percent) * 1e-9 if self.count else 0.0

    def summary(self) -> dict[str, float]:
        """Count, and percentiles and maximum [s]."""
        summary: dict[str, float] = {"count": self.count}
        summary |= {f"p{percent:g}": self.percentile(percent) for percent in PERCENTILES}
        summary["max"] = self.percentile(100.0)
        return summary


class Outcomes:
    """Counts and durations of one client, or of all of them together.

    Attributes:
        latency: From due to answered or timed out.
        round_trip: From sent to answered or timed out.
        solve: The solve time each answer reports.
        lateness: How much later than it could have been a request was sent: the generator's own fault.
        statuses: Answers by status.
        errors: Requests without an answer, by kind.
        timeouts: Requests given up.
        unsent: Requests due and never sent, because the ones before took too long.
        good: Answers that may be followed and came within the time limit after they were due.
    """

    def __init__(self) -> None:
        """Start with nothing."""
        self.latency, self.round_trip, self.solve, self.lateness = (Durations() for _ in range(4))
        self.statuses: Counter[str] = Counter()
        self.errors: Counter[str] = Counter()
        self.timeouts = 0
        self.unsent = 0
        self.good = 0

    @property
    def answered(self) -> int:
        """Requests that got an answer."""
        return self.statuses.total()

    @property
    def failed(self) -> int:
        """Requests that got none."""
        return self.timeouts + self.errors.total() + self.unsent

    @property
    def total(self) -> int:
        """All requests due."""
        return self.answered + self.failed

    def add(self, other: "Outcomes") -> None:
        """Count all of another's outcomes."""
        for mine, theirs in zip(self._durations(), other._durations(), strict=True):
            mine.add(theirs)
        self.statuses.update(other.statuses)
        self.errors.update(other.errors)
        self.timeouts += other.timeouts
        self.unsent += other.unsent
        self.good += other.good

    def _durations(self) -> tuple[Durations, ...]:
        return self.latency, self.round_trip, self.solve, self.lateness
