"""What the solver reaches: the limits it was asked to meet, each measured beside its number.

    OMP_NUM_THREADS=1 python benchmarks/solver_limits.py [--quick] [--only NAME,...] [--json FILE] [--chart FILE]

Clearances are worked out anew, apart from the solver; errors come from its answers by forward kinematics. The exit code
is 1 when accuracy or safety misses its number. Speed is reported, not judged: it depends on the machine. Everything
takes about ten minutes, most of it a million requests that try to make the robot touch itself. Recorded motion
is looked for in `$IK_DATA/motions`, then in `../shared/data/motions`.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.limits import batch, beyond, pairs, precision, reach, safety, tracking
from benchmarks.limits.rig import FULL, QUICK, Result, Rig, Row, Tell
from benchmarks.peers.environments import Unavailable, prepare

PACKAGES = ("ik-service", "casadi", "pin", "numpy")
ROBOT = "g1"
CHART_SCRIPT = Path(__file__).resolve().parent / "limits" / "chart.py"

MEASUREMENTS: Mapping[str, tuple[str, Callable[[Rig, Tell], Result]]] = {
    "precision": (precision.TITLE, precision.measure),
    "beyond": (beyond.TITLE, beyond.measure),
    "reach": (reach.TITLE, reach.measure),
    "tracking": (tracking.TITLE, tracking.measure),
    "safety": (safety.TITLE, safety.measure),
    "batch": (batch.TITLE, batch.measure),
    "pairs": (pairs.TITLE, pairs.measure),
}


def run(rig: Rig, names: Sequence[str], progress: Progress) -> dict[str, Result]:
    """Take the measurements one after the other."""
    results = {}
    for name in names:
        title, measure = MEASUREMENTS[name]
        task = progress.add_task(title, total=None)

        def tell(done: int, total: int, task: Any = task) -> None:
            progress.update(task, completed=done, total=total)

        results[name] = measure(rig, tell)
    return results


def report(rig: Rig, results: Mapping[str, Result]) -> dict[str, Any]:
    """Everything that was found, JSON-ready."""
    return {
        "environment": environment(PACKAGES),
        "kernel": rig.kernel.kind,
        "note": rig.kernel.note,
        "results": {
            name: {
                "title": MEASUREMENTS[name][0],
                "rows": [_document(row) for row in result.rows],
                "numbers": result.numbers,
            }
            for name, result in results.items()
        },
    }


def table(name: str, result: Result) -> Table:
    """One measurement's table."""
    out = Table(title=f"{name}: {MEASUREMENTS[name][0]}", title_justify="left")
    out.add_column("what")
    for column in ("asked", "measured"):
        out.add_column(column, justify="right" if column == "asked" else "left")
    out.add_column("")
    for row in result.rows:
        verdict = "" if row.met is None else "met" if row.met else "[red]missed" if row.judged else "[yellow]not met"
        out.add_row(row.what, row.asked, row.measured, verdict)
    return out


def draw(numbers: Path, chart: Path) -> str:
    """Draw the chart of saved numbers in the environment that has Matplotlib; return a complaint or nothing."""
    try:
        python = prepare("chart")
    except Unavailable as error:
        return f"no chart: Matplotlib is {error}"
    result = subprocess.run([python, CHART_SCRIPT, numbers, chart], capture_output=True, text=True)
    return f"no chart: {result.stderr.strip().splitlines()[-1]}" if result.returncode else ""


def _document(row: Row) -> dict[str, Any]:
    return {"what": row.what, "asked": row.asked, "measured": row.measured, "met": row.met, "judged": row.judged}


def _chosen(names: str) -> list[str]:
    wanted = names.split(",")
    if unknown := [name for name in wanted if name not in MEASUREMENTS]:
        raise argparse.ArgumentTypeError(f"no measurement {unknown[0]!r}; there are {', '.join(MEASUREMENTS)}")
    return [name for name in MEASUREMENTS if name in wanted]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the measurements."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help="a little of each, to see that all works")
    parser.add_argument(
        "--only",
        type=_chosen,
        metavar="A,B",
        default=list(MEASUREMENTS),
        help=f"only these of {', '.join(MEASUREMENTS)}",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers to FILE")
    parser.add_argument("--chart", type=Path, metavar="FILE", help="draw how cost grows to FILE, PNG or SVG")
    options = parser.parse_args(arguments)
    console = Console(width=max(Console().width, 150))
    rig = Rig.build(ROBOT, QUICK if options.quick else FULL)
    if rig.kernel.note:
        console.print(f"kernel: {rig.kernel.note}")
    with Progress(console=console, transient=True) as progress:
        results = run(rig, options.only, progress)
    for name, result in results.items():
        console.print(table(name, result))
    text = json.dumps(report(rig, results), indent=2) + "\n"
    if options.json:
        options.json.write_text(text, encoding="utf-8")
    if options.chart:
        with tempfile.TemporaryDirectory() as scratch:
            saved = Path(scratch) / "numbers.json"
            saved.write_text(text, encoding="utf-8")
            if complaint := draw(saved, options.chart):
                console.print(complaint)
    failures = [f"{name}: {row.what}" for name, result in results.items() for row in result.rows if row.failed]
    for failure in failures:
        console.print(f"missed: {failure}", style="red")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
