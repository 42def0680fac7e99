"""The service's counters as a Prometheus page: all names, sums and cumulative buckets are made here, at the scrape."""

from collections.abc import Iterable, Sequence
from itertools import accumulate

from prometheus_client import CollectorRegistry, ProcessCollector, generate_latest
from prometheus_client.metrics_core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector

from ik_proto import Status
from ik_service.metrics import Histogram, Metrics


class MetricsPage(Collector):
    """Renders a `Metrics`."""

    def __init__(self, metrics: Metrics) -> None:
        """Register what is rendered: the service's counters, and the process's memory, CPU and files."""
        self._metrics = metrics
        self._registry = CollectorRegistry()
        self._registry.register(self)
        ProcessCollector(registry=self._registry)

    def render(self) -> bytes:
        """Render the Prometheus text format."""
        return generate_latest(self._registry)

    def collect(self) -> Iterable[Metric]:
        """Yield the metric families; called by the registry at every scrape."""
        yield InfoMetricFamily("ik_build", "What is running.", self._metrics.build)
        connections = GaugeMetricFamily("ik_connections", "Open client connections.", labels=["front_end"])
        for name, count in self._metrics.connections.items():
            connections.add_metric([name], count())
        yield connections
        closed = CounterMetricFamily(
            "ik_connections_closed", "Connections closed by the service, by reason.", labels=["front_end", "reason"]
        )
        for name, reasons in self._metrics.closed.items():
            for reason, count in dict(reasons).items():
                closed.add_metric([name, reason], count)
        yield closed
        replies = CounterMetricFamily("ik_requests", "Replies sent, by outcome.", labels=["front_end", "status"])
        latency = HistogramMetricFamily(
            "ik_request_seconds", "Time from a request's bytes to its reply's bytes.", labels=["front_end"]
        )
        solves = HistogramMetricFamily(
            "ik_solve_seconds", "Time inside the solver, of single solves.", labels=["front_end"]
        )
        for front_end in dict.fromkeys(meter.front_end for meter in self._metrics.meters):
            meters = [meter for meter in self._metrics.meters if meter.front_end == front_end]
            for status in Status:
                replies.add_metric([front_end, status.value], sum(meter.outcomes[status] for meter in meters))
            _add(latency, front_end, [meter.requests for meter in meters])
            _add(solves, front_end, [meter.solves for meter in meters])
        yield from (replies, latency, solves)


def _add(family: HistogramMetricFamily, front_end: str, histograms: Sequence[Histogram]) -> None:
    """Add the sum of histograms, in the cumulative form Prometheus wants."""
    names = [f"{bound:.9g}" for bound in histograms[0].bounds] + ["+Inf"]
    counts = [sum(column) for column in zip(*(histogram.counts for histogram in histograms), strict=True)]
    cumulative = list(zip(names, map(float, accumulate(counts)), strict=True))
    family.add_metric([front_end], cumulative, sum(histogram.total for histogram in histograms))
