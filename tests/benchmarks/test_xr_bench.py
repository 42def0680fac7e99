"""The benchmark of the way from a headset to the robot: what it concludes from its numbers, and that it runs."""

import io
import json
from typing import Any

import pytest
from rich.console import Console

from benchmarks import xr
from benchmarks.headset.turn import MODES, Turn
from xr_client.stages import STAGES

SHOWING = ("on", "album")


def turn(mode: str, *, scale: float = 1.0, **others: Any) -> Turn:
    """A turn in which everything is as it was asked for; latencies times a factor."""
    stages = {
        name: {"p50": 10.0 * scale, "p95": 15.0 * scale, "p99": 16.0 * scale, "max": 20.0, "n": 9} for name in STAGES
    }
    if mode not in SHOWING:
        del stages["video"]
    report = {
        "ticks": 500,
        "late": 0,
        "lateness_ms": {"p50": 0.1, "p95": 0.2, "p99": 0.3 * scale, "max": 1.0, "n": 500},
        "stages_ms": stages,
    }
    fields: dict[str, Any] = {
        "mode": mode,
        "seconds": 10.0,
        "poses": 600,
        "missed": 0,
        "gaps_ms": (16.7, 20.0, 30.0),
        "images": 280 if mode in SHOWING else 0,
        "wrist_mm": (1.0, 2.0),
        "changes": 0,
        "report": report,
    }
    return Turn(**(fields | others))


def missed(turns: list[Turn]) -> list[str]:
    return [verdict.what for verdict in xr.verdicts(turns) if not verdict.met]


def test_what_was_asked_for_is_met() -> None:
    assert missed([turn(mode) for mode in MODES]) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"poses": 590}, ["poses a second"]),
        ({"missed": 1}, ["sequence gaps"]),
        ({"wrist_mm": (1.0, 5.1)}, ["wrist from its target"]),
        ({"wrist_mm": (1.0, float("nan"))}, ["wrist from its target"]),
        ({"scale": 1.6}, ["pose to command, p50"]),
        ({"scale": 4.1}, ["capture to shown", "pose to command, p50"]),
    ],
)
def test_what_is_missed_is_told(change: dict[str, Any], words: list[str]) -> None:
    found = missed([turn("on", **change), turn("album"), turn("stalled"), turn("off")])
    assert len(found) == len(words)
    assert all(told.startswith(word) for told, word in zip(found, words, strict=True))


def test_control_that_suffers_from_a_stalled_video_is_told() -> None:
    found = missed([turn("on"), turn("album"), turn("stalled", scale=1.3), turn("off")])
    assert [told.split(",")[1] for told in found] == [" p50", " p99"]
    assert all("while video stalls" in told for told in found)


def test_the_tables_show_every_stage_and_turn() -> None:
    turns = [turn(mode, scale=scale) for scale in (1.0, 2.0, 9.0) for mode in MODES]
    out = io.StringIO()
    console = Console(file=out, width=200)
    console.print(xr.stages_table(turns))
    console.print(xr.turns_table(turns))
    text = out.getvalue()
    assert all(words in text for words in STAGES.values())
    assert "20.00 / 30.00 / 32.00" in text  # the median of the three
    assert text.count("60.0") >= len(turns)
    video = next(line for line in text.splitlines() if "taken to shown" in line)
    assert video.count("–") == 2


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_it_runs(tmp_path, capsys) -> None:
    """On a busy machine bounds may be missed; numbers there are all the same."""
    numbers = tmp_path / "numbers.json"
    code = xr.main(["--seconds", "6", "--rounds", "1", "--json", str(numbers)])
    said = capsys.readouterr()
    assert code in (0, 1)
    assert said.err == ""
    report = json.loads(numbers.read_text())
    assert [one["mode"] for one in report["turns"]] == list(MODES)
    assert all(one["report"]["stages_ms"]["command"]["n"] > 0 for one in report["turns"])
    assert report["turns"][0]["images"] > 0
