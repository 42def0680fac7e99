"""From a hand before an emulated headset to the simulated robot, and the robot's picture back: how long, how well?

    python benchmarks/xr.py [--seconds 60] [--rounds 2] [--json FILE] [--chart FILE] [--screenshot FILE]

Service, robot and `ik-xr --emulate` are processes of their own, and the page runs in Chromium without a screen, with
IWER for a headset. Both hands grip and move for a while, then stop. In turns the video is shown, drawn as it is wanted
or beforehand; it stalls, because the page no longer says that it has shown an image; and it is off. Whether control
suffers from video is seen side by side.

Everything runs on this machine, browser and rendering included, in software: it should be quiet, and have nothing else
to do. Exit code 1: something that was asked for was missed.
"""

import argparse
import os
import statistics
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.headset.browser import Lost, chromium
from benchmarks.headset.turn import MODES, REST_S, Turn, run_turn, world
from benchmarks.load.results import Verdict, at_most, judge, save, verdict_documents
from xr_client.stages import STAGES

PACKAGES = ("ik-service", "aiohttp", "mujoco", "playwright", "numpy")
CHART_SCRIPT = Path(__file__).resolve().parent / "headset" / "chart.py"
MOST_SECONDS, LEAST_SECONDS = 600.0, 6.0

POSES_PER_S = 60.0
SHOWN_LIMIT_MS, COMMAND_LIMIT_MS, WRIST_LIMIT_MM = 40.0, 15.0, 5.0
TOUCHED_MS = 2.0
"""How much slower control may be while video stalls before it counts as touched [ms]."""

NAMES = {"on": "video shown", "album": "drawn beforehand", "stalled": "video stalls", "off": "no video"}


def middle(turns: Sequence[Turn], number: Callable[[Turn], float]) -> float:
    """Median over the turns."""
    return statistics.median(number(turn) for turn in turns)


def stages_table(turns: Sequence[Turn]) -> Table:
    """Latencies of each stage, the modes beside each other."""
    out = Table(title="ms: p50 / p95 / p99, median of the turns", title_justify="left")
    out.add_column("stage")
    for mode in MODES:
        out.add_column(NAMES[mode], justify="right")
    rows: list[tuple[str, Callable[[Turn, str], float]]] = [
        (f"{name}: {words}", lambda turn, percentile, name=name: turn.stage(name, percentile))
        for name, words in STAGES.items()
    ]
    rows.append(("a tick's lateness", lambda turn, percentile: turn.lateness(percentile)))
    for words, number in rows:
        cells = []
        for mode in MODES:
            mine = [turn for turn in turns if turn.mode == mode]
            numbers = [middle(mine, lambda turn, p=p, number=number: number(turn, p)) for p in ("p50", "p95", "p99")]
            cells.append("–" if numbers[0] != numbers[0] else " / ".join(f"{number:.2f}" for number in numbers))
        out.add_row(words, *cells)
    return out


def turns_table(turns: Sequence[Turn]) -> Table:
    """Each turn in a row."""
    out = Table(title="turn by turn", title_justify="left")
    out.add_column("video")
    columns = ("poses/s", "missed", "gap p99", "longest gap", "images/s", "late ticks", "held", "wrists")
    for name in columns:
        out.add_column(name, justify="right")
    for turn in turns:
        _, gap, longest = turn.gaps_ms
        out.add_row(
            NAMES[turn.mode],
            f"{turn.poses_per_s:.1f}",
            str(turn.missed),
            f"{gap:.1f} ms",
            f"{longest:.1f} ms",
            f"{turn.images / turn.seconds:.1f}",
            f"{turn.report['late']} of {turn.report['ticks']}",
            str(turn.changes // 2),
            " ".join(f"{distance:.2f}" for distance in turn.wrist_mm) + " mm",
        )
    out.caption = (
        "held: how often an arm did while the hands moved, because poses came late; "
        f"wrists: from their targets {REST_S:g} s after the hands had stopped, left and right"
    )
    return out


def verdicts(turns: Sequence[Turn]) -> list[Verdict]:
    """What was asked for."""
    by = {mode: [turn for turn in turns if turn.mode == mode] for mode in MODES}
    rate = min(turn.poses_per_s for turn in by["on"])

    def touched(words: str, number: Callable[[Turn], float]) -> Verdict:
        return at_most(
            f"{words}, how much more while video stalls",
            middle(by["stalled"], number) - middle(by["on"], number),
            TOUCHED_MS,
            "ms",
        )

    return [
        Verdict(
            "poses a second with video", f"{rate:.1f}", f"≥ {POSES_PER_S:g}, to the nearest", round(rate) >= POSES_PER_S
        ),
        at_most("sequence gaps", sum(turn.missed for turn in turns), 0),
        at_most(
            "capture to shown, p50, pictures drawn beforehand",
            middle(by["album"], lambda turn: turn.stage("video", "p50")),
            SHOWN_LIMIT_MS,
            "ms",
        ),
        at_most(
            "capture to shown, p50", middle(by["on"], lambda turn: turn.stage("video", "p50")), SHOWN_LIMIT_MS, "ms"
        ),
        at_most(
            "pose to command, p50", middle(by["on"], lambda turn: turn.stage("command", "p50")), COMMAND_LIMIT_MS, "ms"
        ),
        touched("pose to command, p50", lambda turn: turn.stage("command", "p50")),
        touched("pose to command, p99", lambda turn: turn.stage("command", "p99")),
        touched("lateness of a tick, p99", lambda turn: turn.lateness("p99")),
        at_most("wrist from its target", float(np.max([turn.wrist_mm for turn in turns])), WRIST_LIMIT_MM, "mm"),
    ]


def measure(options: argparse.Namespace, progress: Progress) -> list[Turn]:
    """All turns, in the order in which they were taken; who begins rotates."""
    turns: list[Turn] = []
    task = progress.add_task("turns", total=len(MODES) * options.rounds)
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        for round_ in range(options.rounds):
            first = round_ % len(MODES)
            for mode in (*MODES[first:], *MODES[:first]):
                # Each with a robot of its own: where an arm held, the next hands would begin somewhere else.
                with world(Path(folder)) as around:
                    screenshot = options.screenshot if mode == "on" else None
                    turns.append(run_turn(around, browser, mode, options.seconds, screenshot))
                progress.update(task, completed=len(turns))
    return turns


def document(turns: Sequence[Turn], judged: Sequence[Verdict], options: argparse.Namespace) -> dict[str, Any]:
    """All of it, JSON-ready."""
    return {
        "kind": "xr",
        "environment": environment(PACKAGES),
        "seconds": options.seconds,
        "limits": {"video_ms": SHOWN_LIMIT_MS, "command_ms": COMMAND_LIMIT_MS, "wrist_mm": WRIST_LIMIT_MM},
        "stages": STAGES,
        "modes": NAMES,
        "turns": [asdict(turn) | {"poses_per_s": turn.poses_per_s} for turn in turns],
        "verdicts": verdict_documents(judged),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, metavar="S", help="how long hands move in a turn (60)")
    parser.add_argument("--rounds", type=int, default=2, metavar="N", help="turns of each kind (2)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers")
    parser.add_argument("--chart", type=Path, metavar="FILE", help="draw the latencies, PNG or SVG")
    parser.add_argument("--screenshot", type=Path, metavar="FILE", help="save what both eyes see, PNG")
    options = parser.parse_args(arguments)
    if options.rounds < 1 or not LEAST_SECONDS <= options.seconds <= MOST_SECONDS:
        parser.error(f"--rounds must be positive, --seconds from {LEAST_SECONDS:g} to {MOST_SECONDS:g}")
    console = Console(width=max(Console().width, 120))
    with Progress(console=console, transient=True) as progress:
        try:
            turns = measure(options, progress)
        except Lost as error:
            progress.stop()
            print(f"xr: {error}", file=sys.stderr)
            return 1
    console.print(stages_table(turns))
    console.print(turns_table(turns))
    judged = verdicts(turns)
    save(document(turns, judged, options), options.json, options.chart, console, script=CHART_SCRIPT)
    return judge(judged, console)


if __name__ == "__main__":
    sys.exit(main())
