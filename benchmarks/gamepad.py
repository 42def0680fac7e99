"""From a stick to the command that leaves for the robot: how long, with the wait for the next tick?

    python benchmarks/gamepad.py [--pushes 200] [--rates 250 50] [--json FILE] [--chart FILE]

Service, robot and `ik-gamepad` are processes of their own, over TCP. The pad is SDL's virtual one, in the process of
`ik-gamepad`, so that its events go SDL's own way. A stick at rest is pushed at a random moment; the clock stops when
the first command with moved joints has gone over TCP to whoever listens in before the robot. Exit code 1: something
that was asked for was missed.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.load.processes import child, first_line
from benchmarks.load.results import Verdict, at_most, judge, save, verdict_documents
from benchmarks.pad.tap import Tap

PACKAGES = ("ik-service", "pygame-ce", "mujoco", "ruckig", "numpy")
PAD = Path(__file__).resolve().parents[1] / "tests" / "gamepad" / "pad_process.py"
CHART_SCRIPT = Path(__file__).resolve().parent / "pad" / "chart.py"

ASKED_MS = 5.0
"""Stick to command, median, with the rate `ik-gamepad` has by default."""
DEFAULT_RATE = 250.0

REST_S, PUSH_S, LIMIT_S = 0.25, 0.12, 30.0
MOVED = 1e-7
"""Change of a joint that counts as moved [rad]: at rest, commands are the same to the bit."""


@dataclass(frozen=True, slots=True)
class Turn:
    """What a rate showed.

    Attributes:
        rate: Ticks of the loop in a second.
        latencies_ms: From a stick's event to the first command with moved joints, of each push [ms].
        report: What `ik-gamepad` wrote.
    """

    rate: float
    latencies_ms: list[float]
    report: dict[str, Any]

    def percentile(self, percent: float) -> float:
        return float(np.percentile(self.latencies_ms, percent)) if self.latencies_ms else float("nan")


@contextmanager
def world() -> Generator[tuple[str, str]]:
    """Addresses of a service and a robot, each with all cores."""
    everywhere = os.sched_getaffinity(0)
    serving = ["-m", "ik_service", "serve", "--tcp", "127.0.0.1:0", "--zenoh", "off", "--http", "off"]
    robot = ["-m", "sim_client", "--listen", "127.0.0.1:0", "--headless", "--eyes-to", "off"]
    with (
        child([*serving, "--log-format", "json"], everywhere) as served,
        child(robot, everywhere) as robot_end,
    ):
        service = "tcp://" + json.loads(first_line(served, "the service"))["tcp"]
        yield service, "tcp://" + json.loads(first_line(robot_end, "the robot"))["listen"]


def run_turn(service: str, robot: str, rate: float, pushes: int, folder: Path) -> Turn:
    """Push a stick again and again."""
    events, report = folder / "events.jsonl", folder / "report.json"
    events.write_text("")
    tap = Tap(robot)
    options = ["--service", service, "--robot", tap.url, "--rate", f"{rate:g}", "--report", str(report)]
    with child([str(PAD), "--events", str(events), *options], os.sched_getaffinity(0)) as process:
        first_line(process, "ik-gamepad")
        assert process.stdin is not None

        def do(*words: object) -> None:
            assert process.stdin is not None
            process.stdin.write(" ".join(map(str, words)) + "\n")
            process.stdin.flush()

        def engaged() -> bool:
            return bool(tap.commands) and tap.commands[-1][1]

        def engage() -> None:
            end = time.monotonic() + LIMIT_S
            while not engaged():
                if time.monotonic() > end:
                    raise SystemExit("gamepad: the arms never follow")
                do("button", "left_shoulder", 0)
                time.sleep(0.1)
                do("button", "left_shoulder", 1)
                time.sleep(0.4)

        rng = np.random.default_rng(0)
        pushed = []
        for k in range(pushes):
            engage()
            time.sleep(REST_S + rng.uniform(0.0, 0.02))
            pushed.append(time.monotonic())
            do("axis", "left_stick_y", (-1.0, 1.0)[k % 2])
            time.sleep(PUSH_S)
            do("axis", "left_stick_y", 0.0)
        time.sleep(REST_S)
        process.terminate()
        process.wait(10.0)
    tap.close()
    told = [json.loads(line) for line in events.read_text().splitlines()]
    begins = [when for when, words in told if words.startswith("axis") and not words.endswith(" 0.0")]
    return Turn(rate, latencies(begins, tap.commands), json.loads(report.read_text()))


def latencies(begins: Sequence[float], commands: Sequence[tuple[float, bool, np.ndarray]]) -> list[float]:
    """Time from each push to the first command that moves [ms]; a push that moved nothing is left out."""
    times = np.array([when for when, _, _ in commands])
    joints = np.array([q for _, _, q in commands])
    found = []
    for begin, limit in zip(begins, [*begins[1:], np.inf], strict=True):
        first = int(np.searchsorted(times, begin))
        if first == 0 or first >= len(times) or np.abs(joints[first - 1] - joints[max(first - 3, 0)]).max() > MOVED:
            continue  # It was not at rest.
        moved = np.flatnonzero(np.abs(joints[first:] - joints[first - 1]).max(axis=1) > MOVED)
        if len(moved) and times[first + moved[0]] < min(limit, begin + PUSH_S):
            found.append(1e3 * (times[first + moved[0]] - begin))
    return found


def table(turns: Sequence[Turn]) -> Table:
    """Each rate in a row."""
    out = Table(title="from a stick to the command that leaves, ms", title_justify="left")
    for name in ("rate", "pushes", "p50", "p95", "p99", "max", "asked of p50", "of it: sticks read to sent, p50"):
        out.add_column(name, justify="right")
    for turn in turns:
        asked = f"{ASKED_MS:g}" if turn.rate == DEFAULT_RATE else ""
        numbers = (f"{turn.percentile(percent):.2f}" for percent in (50, 95, 99, 100))
        of_it = turn.report["stages_ms"]["command"]["p50"]
        out.add_row(f"{turn.rate:g} Hz", str(len(turn.latencies_ms)), *numbers, asked, f"{of_it:.2f}")
    return out


def verdicts(turns: Sequence[Turn], pushes: int) -> list[Verdict]:
    """What was asked for."""
    judged = []
    for turn in turns:
        if turn.rate == DEFAULT_RATE:
            judged.append(at_most(f"stick to command, p50, at {turn.rate:g} Hz", turn.percentile(50), ASKED_MS, "ms"))
        counted = len(turn.latencies_ms)
        enough = counted >= 0.9 * pushes
        judged.append(Verdict(f"pushes that moved the arm, at {turn.rate:g} Hz", str(counted), "≥ 90 %", enough))
    return judged


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pushes", type=int, default=200, metavar="N", help="pushes of the stick at each rate (200)")
    parser.add_argument(
        "--rates", type=float, nargs="+", default=[DEFAULT_RATE, 50.0], metavar="HZ", help="ticks a second (250 50)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers")
    parser.add_argument("--chart", type=Path, metavar="FILE", help="draw the latencies, PNG or SVG")
    options = parser.parse_args(arguments)
    if options.pushes < 1:
        parser.error("--pushes must be positive")
    console = Console(width=max(Console().width, 120))
    turns: list[Turn] = []
    with Progress(console=console, transient=True) as progress, tempfile.TemporaryDirectory() as folder:
        task = progress.add_task("rates", total=len(options.rates))
        for rate in options.rates:
            with world() as (service, robot):  # a robot of its own, so that the arm begins where it did
                turns.append(run_turn(service, robot, rate, options.pushes, Path(folder)))
            progress.advance(task)
    console.print(table(turns))
    judged = verdicts(turns, options.pushes)
    document = {
        "kind": "gamepad",
        "environment": environment(PACKAGES),
        "asked_ms": ASKED_MS,
        "turns": [asdict(turn) for turn in turns],
        "verdicts": verdict_documents(judged),
    }
    save(document, options.json, options.chart, console, script=CHART_SCRIPT)
    return judge(judged, console)


if __name__ == "__main__":
    sys.exit(main())
