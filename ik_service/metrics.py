"""What the service counts.

The request path only increments plain numbers, about 0.5 us a request; naming and summing them is left to the reader.
Each front end owns its `Meter`s and writes each from one thread. A reader may catch one between two increments, so a
sum can be one request ahead of its count.
"""

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence

from ik_proto import Status

REQUEST_BUCKETS = (10e-6, 20e-6, 40e-6, 70e-6, 120e-6, *(200e-6 * 1.6**n for n in range(20)))
"""Upper bounds of the request histogram [s]: fine where the service should be, then 0.2 ms x 1.6^n up to 1.5 s."""

SOLVE_BUCKETS = (
    2e-6,
    4e-6,
    6e-6,
    8e-6,
    10e-6,
    15e-6,
    20e-6,
    30e-6,
    50e-6,
    75e-6,
    100e-6,
    150e-6,
    250e-6,
    500e-6,
    1e-3,
    2e-3,
    5e-3,
    10e-3,
    20e-3,
    50e-3,
    100e-3,
)
"""Upper bounds of the solve histogram [s]: compiled kernels take about 10 us, interpreted ones about 100 us, either ten
times as long to avoid a collision and up to a thousand times in mode `reach`."""


class Histogram:
    """Counts of durations by bucket, not cumulative.

    Attributes:
        bounds: Upper bounds [s], ascending; one more bucket takes everything beyond.
        counts: Durations seen in each bucket.
        total: Sum of all durations [s].
    """

    __slots__ = ("bounds", "counts", "total")

    def __init__(self, bounds: Sequence[float]) -> None:
        """Start empty."""
        self.bounds = tuple(bounds)
        self.counts = [0] * (len(bounds) + 1)
        self.total = 0.0

    def observe(self, seconds: float) -> None:
        """Count one duration [s]."""
        self.counts[bisect_left(self.bounds, seconds)] += 1
        self.total += seconds


class Meter:
    """The counters of one thread of one front end.

    Attributes:
        front_end: "tcp" or "zenoh".
        requests: Time from a request's bytes to its reply's bytes.
        solves: Time inside the solver, of single solves.
        outcomes: Replies by status.
    """

    __slots__ = ("front_end", "outcomes", "requests", "solves")

    def __init__(self, front_end: str) -> None:
        """Start at zero."""
        self.front_end = front_end
        self.requests = Histogram(REQUEST_BUCKETS)
        self.solves = Histogram(SOLVE_BUCKETS)
        self.outcomes = dict.fromkeys(Status, 0)

    def record(self, status: Status, seconds: float, solve_seconds: float | None) -> None:
        """Count one reply.

        Args:
            status: Its status.
            seconds: Time from the request's bytes to the reply's [s].
            solve_seconds: Time in the solver [s]; None when it was not reached.
        """
        self.outcomes[status] += 1
        self.requests.observe(seconds)
        if solve_seconds is not None:
            self.solves.observe(solve_seconds)


class Metrics:
    """All counters of the process.

    Attributes:
        build: What is running, such as version and robot.
        meters: Every meter handed out.
        connections: Functions that tell a front end's open connections, by front end.
        closed: Connections that a front end closed, by reason, by front end.
    """

    def __init__(self, build: dict[str, str]) -> None:
        """Start without front ends."""
        self.build = build
        self.meters: list[Meter] = []
        self.connections: dict[str, Callable[[], int]] = {}
        self.closed: dict[str, Mapping[str, int]] = {}

    def meter(self, front_end: str) -> Meter:
        """Add a meter; several of one front end are added up."""
        meter = Meter(front_end)
        self.meters.append(meter)
        return meter
