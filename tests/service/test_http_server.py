"""Health and metrics of a real service, and what a scrape says of known requests."""

import urllib.error
import urllib.request
from collections.abc import Callable
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families

from ik_proto import Status
from ik_service.metrics import REQUEST_BUCKETS, Metrics
from ik_service.prometheus import MetricsPage


def get(service: Any, path: str, **headers: str) -> tuple[int, str]:
    try:
        request = urllib.request.Request(service.http_url + path, headers=headers)
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def samples(page: str) -> dict[tuple[str, ...], float]:
    """Values by name and label values, as Prometheus' own parser reads them."""
    return {
        (sample.name, *sample.labels.values()): sample.value
        for family in text_string_to_metric_families(page)
        for sample in family.samples
    }


@pytest.mark.parametrize(("path", "status"), [("/healthz", 200), ("/readyz", 200), ("/metrics", 200), ("/else", 404)])
def test_pages(service_process: Any, path: str, status: int) -> None:
    assert get(service_process, path)[0] == status


def test_a_scrape_counts_what_was_asked(
    start_service: Callable[..., Any], raw_client: Callable[..., Any], document: Callable[..., dict[str, Any]]
) -> None:
    service = start_service("--zenoh", "off")
    client = raw_client(service.tcp)
    for seed in range(5):
        assert client.ask(document(seed))["success"]
    assert client.ask({"q": 1})["status"] == "bad_request"
    assert client.ask(document(mode="reach"))["success"]
    batch = {name: [value] for name, value in document().items() if isinstance(value, list)}
    assert client.ask({"verb": "solve_batch", **batch})["success"]
    values = samples(get(service, "/metrics")[1])
    assert values["ik_requests_total", "tcp", "ok"] == 7
    assert values["ik_requests_total", "tcp", "bad_request"] == 1
    assert values["ik_request_seconds_count", "tcp"] == 8
    assert values["ik_solve_seconds_count", "tcp"] == 6  # not the batch
    assert 0 < values["ik_solve_seconds_sum", "tcp"] < values["ik_request_seconds_sum", "tcp"]
    assert values["ik_connections", "tcp"] == 1
    assert any(name[0] == "ik_build_info" and service.ready["boot_id"] in name for name in values)
    assert values["process_resident_memory_bytes",] > 0


def test_buckets_are_cumulative_and_meters_of_one_front_end_add_up() -> None:
    metrics = Metrics({"version": "test"})
    first, second = metrics.meter("zenoh"), metrics.meter("zenoh")
    first.record(Status.OK, REQUEST_BUCKETS[0], 3e-6)
    second.record(Status.OK, REQUEST_BUCKETS[0] * 1.01, None)
    second.record(Status.INTERNAL, 10.0, None)
    values = samples(MetricsPage(metrics).render().decode())
    assert values["ik_request_seconds_bucket", "zenoh", f"{REQUEST_BUCKETS[0]:.9g}"] == 1
    assert values["ik_request_seconds_bucket", "zenoh", f"{REQUEST_BUCKETS[1]:.9g}"] == 2
    assert values["ik_request_seconds_bucket", "zenoh", "+Inf"] == 3
    assert values["ik_request_seconds_count", "zenoh"] == 3
    assert values["ik_requests_total", "zenoh", "ok"] == 2
    assert values["ik_solve_seconds_count", "zenoh"] == 1
