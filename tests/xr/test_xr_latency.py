"""Stages of ticks, and what is told of a run."""

from types import SimpleNamespace
from typing import Any

import pytest
from xr_samples import packet

from xr_client.look import Look
from xr_client.run_report import RunReport
from xr_client.stages import STAGES, Stages
from xr_client.tracker import Arrival, Tracker


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


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


def test_without_samples_every_stage_is_empty():
    assert Stages().recent() == dict.fromkeys(STAGES)


def test_the_report_holds_what_a_program_needs(tmp_path):
    report = RunReport(Stages(), Tracker())
    report.lateness.add(0.1)
    report.write(tmp_path / "report.json")
    document = report.document()
    assert (tmp_path / "report.json").read_text().endswith("}\n")
    assert document["lateness_ms"]["n"] == 1
    assert document["packets"] == {"accepted": 0, "dropped": 0, "missed": 0}
    assert next(report.lines()).startswith("0 ticks, 0 of them late")
