"""ik-service next to other inverse-kinematics libraries, on one model and the same workloads, in one run.

Peers are installed by uv into environments of their own (see `benchmarks/peers`); one that cannot be had here is named
with the reason. Rows take turns block by block. Each is timed in its own process around one Python call, targets in and
joints out, both arms. docs/benchmarks.md says what is compared, with which settings, and why.

    python benchmarks/compare_peers.py [--quick] [--peers pink,mink,...] [--json FILE] [--chart FILE]
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress

from benchmarks.clips import clips
from benchmarks.clips import folder as clip_folder
from benchmarks.environment import environment
from benchmarks.peers.driver import BLOCK, Comparison, Suite, compare
from benchmarks.peers.environments import Unavailable, prepare
from benchmarks.peers.metrics import summary
from benchmarks.peers.report import absent_table, table
from benchmarks.peers.roster import OURS, ROBOT, ROWS, Row
from benchmarks.self_clearance import self_clearance
from benchmarks.workloads import cold, crossing, tracking, unreachable
from ik_proto.robots import load_description
from ik_service.robot import Robot

PACKAGES = ("ik-service", "casadi", "pin", "numpy")
CHART_SCRIPT = Path(__file__).resolve().parent / "peers" / "chart.py"


def suite(robot: Robot, quick: bool) -> Suite:
    """The workloads; recorded motion only where it is at hand."""
    if quick:
        return {
            "tracking": [tracking(robot, 100)],
            "crossing": [crossing(robot, 300)],
            "recorded": clips(robot, 50)[:2],
            "unreachable": [unreachable(robot, 50)],
            "cold": [cold(robot, 50)],
        }
    return {
        "tracking": [tracking(robot)],
        "crossing": [crossing(robot)],
        "recorded": clips(robot),
        "unreachable": [unreachable(robot)],
        "cold": [cold(robot)],
    }


def report(robot: Robot, workloads: Suite, comparison: Comparison) -> dict[str, Any]:
    """All numbers of a comparison, JSON-ready."""
    contestants = comparison.contestants
    own = [one for one in contestants if one.row in OURS]
    base = own[0] if own else contestants[0] if contestants else None
    clearance = self_clearance(robot)
    results: dict[str, Any] = {}
    for name, group in workloads.items():
        unit = base.runs.get(name) if base else None
        measure = clearance if name == "crossing" else None
        rows = {
            one.row.name: summary(robot, group, one.runs[name], unit, measure)
            for one in contestants
            if name in one.runs
        }
        if rows:
            results[name] = {"frames": sum(map(len, group)), "of": [workload.name for workload in group], "rows": rows}
    return {
        "environment": environment(PACKAGES),
        "success": "both wrists within 1 mm and 1 degree",
        "block": BLOCK,
        "baseline": base.row.name if base else "",
        "rows": {
            one.row.name: {
                "peer": one.row.peer,
                "versions": one.versions,
                "settings": {name: one.row.settings_on(name) for name in one.runs},
                "source": one.row.source,
                "fk_difference": one.fk_difference,
            }
            for one in contestants
        },
        "absent": comparison.absent,
        "results": results,
    }


def draw(numbers: Path, chart: Path) -> str:
    """Draw the chart of saved numbers in the environment that has Matplotlib; return a complaint or nothing."""
    try:
        python = prepare("chart")
    except Unavailable as error:
        return f"no chart: Matplotlib is {error}"
    result = subprocess.run([python, CHART_SCRIPT, numbers, chart], capture_output=True, text=True)
    return f"no chart: {result.stderr.strip().splitlines()[-1]}" if result.returncode else ""


def show(console: Console, numbers: dict[str, Any]) -> None:
    """Print the tables and what they leave out."""
    for name, result in numbers["results"].items():
        console.print(table(name, result, numbers["baseline"]))
    if numbers["absent"]:
        console.print(absent_table(numbers["absent"]))
    agreement = max((row["fk_difference"] for row in numbers["rows"].values()), default=0.0)
    console.print(f"forward kinematics of all rows agrees with ours to {agreement:.1g}")


def _chosen(names: str | None) -> Sequence[Row]:
    known = list(dict.fromkeys(row.peer for row in ROWS))
    wanted = names.split(",") if names else known
    if unknown := [name for name in wanted if name not in known]:
        raise argparse.ArgumentTypeError(f"no peer {unknown[0]!r}; there are {', '.join(known)}")
    return [row for row in ROWS if row.peer in wanted]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the comparison."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help="a few frames of each workload, to see that all works")
    parser.add_argument("--peers", type=_chosen, metavar="A,B", default=ROWS, help="only these (default: all)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers to FILE")
    parser.add_argument("--chart", type=Path, metavar="FILE", help="draw a chart to FILE, PNG or SVG")
    options = parser.parse_args(arguments)
    console = Console(width=max(Console().width, 190))
    description = load_description(ROBOT)
    robot = Robot.load(description)
    workloads = suite(robot, options.quick)
    if not workloads["recorded"]:
        console.print(f"recorded: skipped, no clips in {clip_folder()} (IK_DATA names another place)")
    frames = sum(map(len, (workload for group in workloads.values() for workload in group)))
    with tempfile.TemporaryDirectory() as scratch, Progress(console=console, transient=True) as progress:
        task = progress.add_task("", total=frames * len(options.peers))

        def tell(what: str, solved: int) -> None:
            progress.update(task, description=what, advance=solved)

        comparison = compare(description, robot, workloads, options.peers, Path(scratch), tell)
    numbers = report(robot, workloads, comparison)
    show(console, numbers)
    text = json.dumps(numbers, indent=2) + "\n"
    if options.json:
        options.json.write_text(text, encoding="utf-8")
    if options.chart:
        with tempfile.TemporaryDirectory() as scratch:
            saved = Path(scratch) / "numbers.json"
            saved.write_text(text, encoding="utf-8")
            if complaint := draw(saved, options.chart):
                console.print(complaint)
    return 0 if comparison.contestants else 1


if __name__ == "__main__":
    sys.exit(main())
