"""The benchmark of the camera's latency: what it makes of its turns, and what it asks for."""

import io
from argparse import Namespace
from typing import Any

import pytest
from rich.console import Console

from benchmarks import camera_latency
from benchmarks.camera_latency import Turn, document, table, verdicts
from camera_client.stages import STAGES


def turn(model: str, command: float) -> Turn:
    stages = {name: {"p50": 1.0, "p95": 2.0, "p99": 3.0, "max": 4.0, "n": 9} for name in STAGES}
    stages["command"]["p50"] = command
    return Turn(model, stages, {"p50": 0.1}, seen=99, played=100, late=1, ticks=500, engagements=2)


def words(turns: list[Turn]) -> str:
    console = Console(width=120, file=io.StringIO(), record=True)
    console.print(table(turns))
    return console.export_text()


def test_the_models_stand_beside_each_other_with_the_median_of_their_turns():
    said = words([turn("full", 30.0), turn("lite", 20.0), turn("full", 50.0), turn("full", 40.0)])
    line = next(line for line in said.splitlines() if "command: frame here" in line)
    assert "40.0 / 2.0 / 3.0" in line
    assert "20.0 / 2.0 / 3.0" in line
    assert "297 of 300" in said
    assert "3 of 1500" in said


@pytest.mark.parametrize(("ms", "met"), [(44.9, True), (45.0, True), (45.1, False), (float("nan"), False)])
def test_full_is_asked_for_45_ms(ms, met):
    (verdict,) = verdicts([turn("full", ms), turn("heavy", 500.0)])
    assert verdict.met is met
    assert verdicts([turn("heavy", 1.0)]) == []


def test_the_document_has_every_turn():
    options: Any = Namespace(seconds=30.0, cores=2)
    found = document([turn("full", 30.0)], verdicts([turn("full", 30.0)]), options)
    assert found["kind"] == "camera_latency"
    assert found["turns"][0]["stages_ms"]["command"]["p50"] == 30.0
    assert found["verdicts"][0]["met"] is True
    assert found["environment"]["versions"]["mediapipe"] == "0.10.30"


def test_without_anybody_to_film_it_says_so(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("IK_DATA", str(tmp_path))
    assert camera_latency.main([]) == 2
    assert "set IK_DATA" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["--rounds", "0"], ["--seconds", "1"], ["--cores", "0"]])
def test_options_that_measure_nothing(arguments):
    with pytest.raises(SystemExit):
        camera_latency.main(arguments)
