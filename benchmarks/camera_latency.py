"""From a frame that is here to the command that follows from it: how long, with each pose model?

    python benchmarks/camera_latency.py [--seconds 30] [--rounds 2] [--models full lite heavy] [--json FILE]

Service, robot and `ik-camera` are processes of their own. The camera is a recording of a rendered person who waves,
made beforehand, so that rendering does not compete; it plays in real time, thirty frames a second. Decoding a frame is
counted to the camera, for a camera does it, but it takes its share of the processor all the same. Everything runs on
the cores given by --cores, two by default.

Needs the data with which the camera client is tested (IK_DATA, else ../shared/data), and a machine that has nothing
else to do. Exit code 1: something that was asked for was missed.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.load.processes import child, first_line
from benchmarks.load.results import Verdict, at_most, judge, save, verdict_documents
from benchmarks.rendered import person_folder, rendered

PACKAGES = ("ik-service", "mediapipe", "opencv-python-headless", "numpy", "mujoco")
ASKED_MODEL, ASKED_MS = "full", 45.0
THESIS_MS = 112.0
"""What the thesis needed for the same, with its pose model, processing, transport, IK and command."""
FPS = 30.0
MOST_SECONDS = 600.0


@dataclass(frozen=True, slots=True)
class Turn:
    """One run of `ik-camera`.

    Attributes:
        model: Its pose model.
        stages_ms: Percentiles of each stage [ms], and the number of samples.
        lateness_ms: How late ticks began [ms].
        seen: Frames that came.
        played: Frames in the recording.
        late: Ticks more than a period late.
        ticks: All ticks.
        engagements: How often an arm began to follow; 2 where none was lost.
    """

    model: str
    stages_ms: dict[str, dict[str, float]]
    lateness_ms: dict[str, float]
    seen: int
    played: int
    late: int
    ticks: int
    engagements: int


def film(path: Path, seconds: float, person: Path) -> int:
    """Make the recording; give the number of its frames."""
    keys = [(0.0, "hang", "hang"), (1.0, "hang", "hang"), (2.0, "e90", "goal")]
    dance = rendered("choreography").Choreography((*keys, (seconds, "side", "goal")), wave=(2.2, seconds - 0.2))
    with rendered("scenes").open_scene(person) as scene:
        rendered("filmed").film(path, scene, dance, lambda t: t >= 0.5, fps=FPS)
    return round(seconds * FPS)


def run_turn(model: str, recording: Path, played: int, cores: set[int], folder: Path) -> Turn:
    """Play the recording to a service and a robot of its own."""
    serving = ["-m", "ik_service", "serve", "--tcp", "127.0.0.1:0", "--zenoh", "off", "--http", "off"]
    robot = ["-m", "sim_client", "--listen", "127.0.0.1:0", "--headless", "--eyes-to", "off"]
    report = folder / "report.json"
    with child([*serving, "--log-format", "json"], cores) as served, child(robot, cores) as robot_end:
        service = json.loads(first_line(served, "the service"))["tcp"]
        end = json.loads(first_line(robot_end, "the robot"))["listen"]
        command = ["taskset", "-c", ",".join(map(str, sorted(cores))), sys.executable, "-m", "camera_client", "run"]
        command += [
            "--service",
            f"tcp://{service}",
            "--robot",
            f"tcp://{end}",
            "--replay",
            str(recording),
            "--model",
            model,
        ]
        command += ["--no-preview", "--report", str(report)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, timeout=MOST_SECONDS + 120.0)
    found = json.loads(report.read_text())
    return Turn(
        model,
        found["stages_ms"],
        found["lateness_ms"],
        found["frames"]["seen"],
        played,
        found["late"],
        found["ticks"],
        found["engagements"],
    )


def middle(turns: Sequence[Turn], stage: str, percentile: str) -> float:
    """Median over the turns [ms]."""
    return statistics.median(turn.stages_ms[stage][percentile] for turn in turns)


def table(turns: Sequence[Turn]) -> Table:
    """Each stage in a row, the models beside each other."""
    from camera_client.stages import STAGES

    models = list(dict.fromkeys(turn.model for turn in turns))
    out = Table(title="ms: p50 / p95 / p99, median of the turns", title_justify="left")
    out.add_column("stage")
    for model in models:
        out.add_column(model, justify="right")
    for name, words in STAGES.items():
        cells = []
        for model in models:
            mine = [turn for turn in turns if turn.model == model]
            cells.append(" / ".join(f"{middle(mine, name, p):.1f}" for p in ("p50", "p95", "p99")))
        out.add_row(f"{name}: {words}", *cells)
    seen = [
        f"{sum(t.seen for t in turns if t.model == m)} of {sum(t.played for t in turns if t.model == m)}"
        for m in models
    ]
    out.add_row("frames used", *seen)
    late = [
        f"{sum(t.late for t in turns if t.model == m)} of {sum(t.ticks for t in turns if t.model == m)}" for m in models
    ]
    out.add_row("late ticks", *late)
    return out


def verdicts(turns: Sequence[Turn]) -> list[Verdict]:
    """What was asked for."""
    mine = [turn for turn in turns if turn.model == ASKED_MODEL]
    if not mine:
        return []
    words = f"frame here to command with {ASKED_MODEL}, p50 (thesis: {THESIS_MS:g} ms)"
    return [at_most(words, middle(mine, "command", "p50"), ASKED_MS, "ms")]


def document(turns: Sequence[Turn], judged: Sequence[Verdict], options: argparse.Namespace) -> dict[str, Any]:
    """All of it, JSON-ready."""
    return {
        "kind": "camera_latency",
        "environment": environment(PACKAGES),
        "seconds": options.seconds,
        "cores": options.cores,
        "asked_ms": ASKED_MS,
        "thesis_ms": THESIS_MS,
        "turns": [asdict(turn) for turn in turns],
        "verdicts": verdict_documents(judged),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, metavar="S", help="length of the recording (30)")
    parser.add_argument("--rounds", type=int, default=2, metavar="N", help="turns with each model (2)")
    parser.add_argument("--models", nargs="+", default=["full", "lite", "heavy"], metavar="MODEL", help="pose models")
    parser.add_argument("--cores", type=int, default=2, metavar="N", help="cores for all processes together (2)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers")
    options = parser.parse_args(arguments)
    if options.rounds < 1 or not 4.0 <= options.seconds <= MOST_SECONDS or options.cores < 1:
        parser.error(f"--rounds and --cores must be positive, --seconds from 4 to {MOST_SECONDS:g}")
    person = person_folder()
    if person is None:
        print("camera_latency: no person to film: set IK_DATA to the folder of the test data", file=sys.stderr)
        return 2
    cores = set(sorted(os.sched_getaffinity(0))[: options.cores])
    console = Console(width=max(Console().width, 120))
    turns: list[Turn] = []
    with tempfile.TemporaryDirectory() as name, Progress(console=console, transient=True) as progress:
        folder = Path(name)
        filming = progress.add_task("filming", total=None)
        played = film(folder / "waving.ikcam", options.seconds, person)
        progress.remove_task(filming)
        task = progress.add_task("turns", total=options.rounds * len(options.models))
        for _ in range(options.rounds):
            for model in options.models:
                turns.append(run_turn(model, folder / "waving.ikcam", played, cores, folder))
                progress.update(task, completed=len(turns))
    console.print(table(turns))
    judged = verdicts(turns)
    save(document(turns, judged, options), options.json, None, console)
    return judge(judged, console)


if __name__ == "__main__":
    sys.exit(main())
