"""Latencies: percentiles against NumPy's, stages of ticks, and what is told of them."""

import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from xr_samples import packet

from xr_client.latency import Latency
from xr_client.look import Look
from xr_client.run_report import RunReport
from xr_client.stages import STAGES, Stages
from xr_client.tracker import Arrival, Tracker

PERCENTS = {"p50": 50.0, "p95": 95.0, "p99": 99.0}


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
    assert Stages().table() == []
    assert Stages().document() == {}
    assert Stages().recent() == dict.fromkeys(STAGES)


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


def arrival(seq: int, time: float) -> Arrival:
    return Arrival(packet(seq, capture_ms=1e3 * seq), Look(None, None, None), (0, 0), time)


def tick(time: float, round_trip: float | None = None) -> Any:
    return SimpleNamespace(time=time, round_trip=round_trip)


def test_each_pose_counts_once_and_to_the_command():
    clock = Clock()
    stages = Stages(clock)
    ages = {1e3: 12.0, 2e3: None}

    def age_ms(capture_ms: float, now: float) -> float | None:
        assert now == clock.now
        return ages[capture_ms]

    stages.observe(tick(99.9), None, age_ms)
    one, two = arrival(1, 99.990), arrival(2, 99.996)
    stages.observe(tick(99.999, 0.001), one, age_ms)
    stages.observe(tick(99.999, 0.002), one, age_ms)
    stages.observe(tick(99.999), two, age_ms)
    found = stages.document()
    assert {name: row["n"] for name, row in found.items()} == {"wait": 2, "service": 2, "command": 1}
    assert found["wait"]["max"] == pytest.approx(9.0)
    assert found["command"]["max"] == 12.0
    assert found["service"]["max"] == pytest.approx(2.0)


def test_in_a_replay_the_command_counts_from_arrival():
    clock = Clock()
    stages = Stages(clock)
    stages.observe(tick(99.999), arrival(1, 99.980), None)
    assert stages.document()["command"]["max"] == pytest.approx(20.0)


def test_the_table_has_a_line_for_each_stage():
    stages = Stages()
    for name in ("service", "video"):
        for ms in (1.0, 2.0, 40.0):
            stages[name].add(ms)
    head, service, video = stages.table()
    assert head.split()[-5:] == ["p50", "p95", "p99", "max", "samples"]
    assert service.split()[0] == "service"
    assert video.split()[-2:] == ["40.00", "3"]
    assert len({len(line) for line in (head, service, video)}) == 1


def test_the_report_holds_what_a_program_needs(tmp_path):
    report = RunReport(Stages(), Tracker())
    report.lateness.add(0.1)
    report.write(tmp_path / "report.json")
    document = report.document()
    assert (tmp_path / "report.json").read_text().endswith("}\n")
    assert document["lateness_ms"]["n"] == 1
    assert document["packets"] == {"accepted": 0, "dropped": 0, "missed": 0}
    assert next(report.lines()).startswith("0 ticks, 0 of them late")
