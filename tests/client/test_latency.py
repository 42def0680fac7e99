"""Latencies: percentiles against NumPy's, and what is told of stages."""

import threading

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ik_client.latency import Latency
from ik_client.stage_latencies import StageLatencies

PERCENTS = {"p50": 50.0, "p95": 95.0, "p99": 99.0}
WORDS = {"landmarks": "picture to landmarks", "service": "asked to answered", "wait": "there to used"}


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@given(st.lists(st.floats(2e-3, 9e4), min_size=1, max_size=60))
def test_percentiles_are_those_of_numpy(samples):
    latency = Latency()
    for sample in samples:
        latency.add(sample)
    found = latency.summary()
    assert found is not None
    assert (found.max, found.n) == (max(samples), len(samples))
    for name, percent in PERCENTS.items():
        # A percentile lies between two samples; which of them is told is the histogram's choice.
        below, above = (np.percentile(samples, percent, method=method) for method in ("lower", "higher"))
        # Whole microseconds, three digits of them.
        assert below * (1.0 - 1e-9) <= getattr(found, name) <= above * 1.001 + 1e-3


def test_samples_beyond_the_scale():
    latency = Latency()
    for sample in (-3.0, 0.0, 1e-9, 1e7):
        latency.add(sample)
    found = latency.summary()
    assert found is not None
    assert (found.n, found.max) == (4, 1e7)
    assert found.p50 <= 1e-3


def test_without_samples_there_is_nothing_to_tell():
    assert Latency().summary() is None
    stages = StageLatencies(WORDS)
    assert stages.table() == []
    assert stages.document() == {}
    assert stages.recent() == dict.fromkeys(WORDS)


def test_what_is_shown_is_calm_and_of_late():
    clock = Clock()
    latency = Latency(clock)
    for sample in [1000.0] * 100 + [5.0] * 31 + [80.0]:
        latency.add(sample)
    assert latency.recent_ms == 5.0
    clock.now += 1.9
    assert latency.recent_ms == 5.0
    clock.now += 0.2
    assert latency.recent_ms is None


def test_one_adds_while_another_looks():
    latency = Latency()
    adder = threading.Thread(target=lambda: [latency.add(0.1 * k) for k in range(1, 20_000)])
    adder.start()
    seen = [0]
    while adder.is_alive():
        found, _ = latency.summary(), latency.recent_ms
        if found:
            assert found.p50 <= found.p99 <= found.max
            seen.append(found.n)
    adder.join()
    assert seen == sorted(seen)
    last = latency.summary()
    assert last is not None
    assert last.n == 19_999


def test_the_table_has_a_line_for_each_stage_with_samples():
    stages = StageLatencies(WORDS)
    for name in ("service", "landmarks"):
        for ms in (1.0, 2.0, 40.0):
            stages[name].add(ms)
    head, landmarks, service = stages.table()
    assert head.split()[-5:] == ["p50", "p95", "p99", "max", "samples"]
    assert service.split()[:3] == ["service", "asked", "to"]
    assert landmarks.split()[-2:] == ["40.00", "3"]
    assert len({len(line) for line in (head, service, landmarks)}) == 1
    assert stages.document()["service"]["max"] == 40.0
    assert stages.recent() == {"landmarks": 2.0, "service": 2.0, "wait": None}
