"""What the load tests share once they have measured: verdicts, a file of numbers, a chart."""

import json
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.peers.environments import Unavailable, prepare

_CHART_SCRIPT = Path(__file__).resolve().parent / "chart.py"


@dataclass(frozen=True, slots=True)
class Verdict:
    """Something that was asked for, and what came of it.

    Attributes:
        what: What was asked about.
        measured: The outcome, with its unit.
        asked: The bound.
        met: Whether it was kept.
    """

    what: str
    measured: str
    asked: str
    met: bool


def at_most(what: str, value: float, limit: float, unit: str = "") -> Verdict:
    """A verdict on a number that may not exceed a limit; NaN exceeds everything."""
    return Verdict(what, f"{value:.4g} {unit}".strip(), f"≤ {limit:g} {unit}".strip(), bool(value <= limit))


def judge(verdicts: Sequence[Verdict], console: Console) -> int:
    """Print the verdicts; give the exit code."""
    for verdict in verdicts:
        mark = "met   " if verdict.met else "[red]missed[/red]"
        console.print(f"{mark} {verdict.what}: {verdict.measured}, asked {verdict.asked}", soft_wrap=True)
    return 0 if all(verdict.met for verdict in verdicts) else 1


def verdict_documents(verdicts: Sequence[Verdict]) -> list[dict[str, Any]]:
    """The same, JSON-ready."""
    return [{"what": v.what, "measured": v.measured, "asked": v.asked, "met": v.met} for v in verdicts]


def save(
    report: Mapping[str, Any], numbers: Path | None, chart: Path | None, console: Console, script: Path = _CHART_SCRIPT
) -> None:
    """Write what was measured.

    Args:
        report: All of it, JSON-ready.
        numbers: File for it; None for none.
        chart: File for a picture of it, PNG or SVG; None for none.
        console: Where a complaint goes when there is nothing to draw with.
        script: What draws it.
    """
    text = json.dumps(report, indent=2) + "\n"
    if numbers is not None:
        numbers.write_text(text, encoding="utf-8")
    if chart is None:
        return
    try:
        python = prepare("chart")
    except Unavailable as error:
        console.print(f"no chart: Matplotlib is {error}")
        return
    with tempfile.TemporaryDirectory() as scratch:
        saved = Path(scratch) / "numbers.json"
        saved.write_text(text, encoding="utf-8")
        drawn = subprocess.run([python, script, saved, chart], capture_output=True, text=True)
    if drawn.returncode:
        console.print(f"no chart: {drawn.stderr.strip().splitlines()[-1]}")
