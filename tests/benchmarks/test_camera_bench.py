"""The benchmark of the camera's chain: what it concludes from its numbers, and what it puts into the page."""

from pathlib import Path
from typing import Any

import pytest

from benchmarks import camera
from benchmarks.dances import page
from benchmarks.dances.means import Cause, Score
from benchmarks.dances.measure import CHAINS, Danced

GOOD: dict[str, Any] = {
    "wrist_mean": 0.03,
    "wrist_p95": 0.08,
    "elbow_p95": 0.07,
    "turn_p95": 12.0,
    "turned_over": 0.002,
    "jumps": 0,
    "spikes": 0,
    "bad_limbs": 0.0,
    "jitter": 0.012,
    "lag": 0.016,
}
REPLAY: dict[str, Any] = {
    "clip": "walk",
    "seconds": 4.0,
    "beyond": -0.05,
    "step": 3.0,
    "clearance": 0.0061,
    "wanted_step": 0.4,
    "possible": 0.9,
    "elbow_p95": 8.0,
    "elbow_like": 0.99,
    "causes": {"late": 3, "in the way": 1},
    "arms": {
        "judged": 400,
        "answer": 396,
        "robot": 380,
        "in_time": 390,
        "answer_in_time": 389,
        "robot_in_time": 375,
        "unlimited": 400,
        "onward_answer": 398,
        "onward_robot": 384,
    },
}


BENT: dict[str, Any] = {
    "waist": "forward",
    "known": {"blocked": 0.01, "robot_like": 0.99},
    "unknown": {"blocked": 0.2, "robot_like": 0.95},
}


def row(dance: str = "full", milliseconds: float = 1.5, **changed: Any) -> Danced:
    scores = {chain: [Score(**GOOD)] for chain in CHAINS}
    # Another seed, which is worse in what is changed.
    scores["ours"].append(Score(**(GOOD | changed)))
    scores["thesis"] = [Score(**(GOOD | {"wrist_mean": 0.2}))]
    traces = {"t": [0.0], "truth": [0.0], **{chain: [0.0] for chain in CHAINS}}
    return Danced("somebody", dance, True, scores, milliseconds, traces)


def missed(rows: list[Danced], replays: list[dict[str, Any]]) -> list[str]:
    return [verdict.what for verdict in camera.verdicts(rows, replays) if not verdict.met]


def test_what_was_asked_for_is_met() -> None:
    assert missed([row()], [REPLAY]) == []
    # The published chain is not judged, and neither is a drawn dance.
    assert missed([row(), row("drawn101", turn_p95=40.0)], [REPLAY]) == []


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("wrist_mean", 0.041),
        ("wrist_p95", 0.11),
        ("turn_p95", 15.1),
        ("turned_over", 0.006),
        ("jumps", 1),
        ("spikes", 1),
        ("bad_limbs", 0.006),
        ("jitter", 0.0151),
        ("lag", 0.026),
        ("lag", float("nan")),
    ],
)
def test_the_worst_seed_is_judged(name: str, value: float) -> None:
    assert missed([row("full", 1.5, **{name: value})], [REPLAY]) == [f"somebody, {camera.ASKED[name][2]}"]


def test_time_and_bounds_are_judged() -> None:
    assert missed([row(milliseconds=2.1)], [REPLAY]) == ["a frame, median"]
    assert missed([row()], [REPLAY | {"beyond": 0.001}]) == ["beyond a joint limit"]
    assert missed([row()], [REPLAY | {"step": 3.01}]) == ["fastest joint"]
    assert missed([row()], [REPLAY | {"clearance": 0.0049}]) == ["nearer to itself than is kept"]


def test_the_page_takes_the_tables() -> None:
    text = (Path(__file__).parents[2] / "docs" / "camera-accuracy.md").read_text(encoding="utf-8")
    numbers = {
        "environment": {"when": "2026-01-01T00:00", "cpu": "some", "cores": 2, "load": 0.5},
        "seeds": [1],
        "asked": {name: list(what) for name, what in camera.ASKED.items()},
        "names": camera.NAMES,
        "dances": [row().document()],
        "budget": {"body": "somebody", "scores": {"exact depth": GOOD}},
        "replays": [REPLAY],
        "bent": [BENT],
        "elbow_like": 12.0,
    }
    filled = page.fill(text, numbers)
    assert "| somebody | full | ik-camera | 3.0 | 8.0 | 12.0 | 0.2 | 0 | 0 | 0.0 | 12.0 | 16.0 |" in filled
    assert "| somebody | full | as published | 20.0 |" in filled
    assert "| exact depth | 3.0 | 8.0 | 12.0 | 12.0 |" in filled
    assert "| walk | 4 | 0.050 | 3.00 | 6.1 | 0.40 | 90% | 99.0% | 8.0 | 95.0% |" in filled
    missed = "400 | 4 | 3 | 0 | 1 | 0 | 0 | 0 | 97.5% | 99.7% | 96.2% | 100.0% | 99.5% | 96.0% |"
    assert f"| walk | {missed}" in filled
    assert f"| all | {missed}" in filled
    assert page.fill(filled, numbers) == filled
    assert "| forward | 1.0% | 20.0% | 99.0% | 95.0% |" in filled
    # Replays alone leave the rest as it is.
    alone = {"replays": [REPLAY | {"clip": "run"}], "bent": [BENT], "elbow_like": 12.0}
    assert page.fill(filled, alone) == filled.replace("| walk |", "| run |")


def test_replays_alone_are_judged() -> None:
    assert missed([], [REPLAY]) == []
    assert missed([], [REPLAY | {"step": 3.01}]) == ["fastest joint"]


def test_the_causes_in_the_page_are_those_that_are_found() -> None:
    assert set(page.CAUSES) == {str(cause) for cause in Cause}
