"""How well does the camera client follow arms? Rendered people with known joints, real landmarks, three chains.

    python benchmarks/camera.py [--quick] [--replays] [--material FOLDER] [--json FILE] [--chart FILE]

People who were never seen while the chain was made dance before a rendered depth camera: the full dance, and one drawn
at random. MediaPipe's *full* model finds their landmarks, depth gets an OAK's noise, and an operator is calibrated on
the T pose of the same dance. On the same frames: this chain, the same without depth (a webcam), and the published one.
Then recorded motion of people is taken to the robot: wrist basis, way out of the body, inverse kinematics, limiter.
That alone: `--replays`.

Rendering and MediaPipe take most of the time; `--material` keeps what they gave. Data: `../shared/data`, or `$IK_DATA`.
Exit code 1: the full dance was followed worse than was asked, or the robot left its bounds.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.dances.means import ELBOW_LIKE, FPS, takes
from benchmarks.dances.measure import CHAINS, Danced, budget, danced, rendered
from benchmarks.dances.replays import replayed, replayed_bent
from benchmarks.environment import environment
from benchmarks.load.results import Verdict, at_most, judge, save, verdict_documents
from camera_client.models import ModelError
from camera_client.pose_library import NoMediaPipe
from ik_client.clear_way import KEPT
from ik_client.joint_limiter import MotionLimits
from sim_client.gl import NoRendering

PACKAGES = ("ik-service", "mediapipe", "mujoco", "numpy")
CHART_SCRIPT = Path(__file__).resolve().parent / "dances" / "chart.py"
SEEDS = (21, 22)
"""Of the camera's noise, other than those of the tests."""

ASKED = {
    "wrist_mean": (100.0, 4.0, "wrist mean", "cm"),
    "wrist_p95": (100.0, 10.0, "wrist p95", "cm"),
    "turn_p95": (1.0, 15.0, "orientation p95", "deg"),
    "turned_over": (100.0, 0.5, "> 45 deg", "%"),
    "jumps": (1.0, 0, "jumps", ""),
    "spikes": (1.0, 0, "spikes", ""),
    "bad_limbs": (100.0, 0.5, "bad limbs", "%"),
    "jitter": (1000.0, 15.0, "hold jitter", "mm"),
    "lag": (1000.0, 25.0, "lag", "ms"),
}
"""Of each number of a score: its unit, what was asked at most, and how it is called."""
MOST_MILLISECONDS = 2.0
NAMES = {"ours": "ik-camera", "webcam": "without depth", "thesis": "as published"}


def dances_table(rows: Sequence[Danced]) -> Table:
    """Bodies and dances, the chains below each other."""
    out = Table(title="the worst of the seeds", title_justify="left")
    for heading in ("body", "dance", "chain"):
        out.add_column(heading)
    for _, limit, words, unit in ASKED.values():
        out.add_column(f"{words} [{unit}]\n≤ {limit:g}" if unit else f"{words}\n≤ {limit:g}", justify="right")
    for row in rows:
        for chain in CHAINS:
            worst = row.worst(chain)
            cells = [f"{scale * worst[name]:.{0 if limit == 0 else 1}f}" for name, (scale, limit, *_) in ASKED.items()]
            out.add_row(row.body, row.dance, NAMES[chain], *cells)
    return out


def replay_table(rows: Sequence[dict[str, Any]]) -> Table:
    """Clips of people's motion."""
    out = Table(title="recorded motion on the robot", title_justify="left")
    headings = ("clip", "s", "beyond limits [rad]", "fastest [rad/s]", "clear [mm]", "answer's step [rad]")
    for heading in (*headings, "possible", f"elbow ≤ {ELBOW_LIKE:g} deg", "elbow p95", "robot's", "in time", "missed"):
        out.add_column(heading, justify="left" if heading == "clip" else "right")
    for row in rows:
        out.add_row(
            row["clip"],
            f"{row['seconds']:.0f}",
            f"{row['beyond']:.3f}",
            f"{row['step']:.2f}",
            f"{1000.0 * row['clearance']:.1f}",
            f"{row['wanted_step']:.2f}",
            f"{row['possible']:.0%}",
            f"{row['elbow_like']:.1%}",
            f"{row['elbow_p95']:.1f}",
            *(f"{row['arms'][name] / max(row['arms']['judged'], 1):.1%}" for name in ("robot", "in_time")),
            ", ".join(f"{count} {cause}" for cause, count in row["causes"].items()),
        )
    out.caption = "possible: where some posture within limits, clear of the body, has the person's wrist and elbow"
    return out


def verdicts(rows: Sequence[Danced], replays: Sequence[dict[str, Any]]) -> list[Verdict]:
    """What was asked for."""
    out = []
    for row in rows:
        if row.dance != "full":
            continue
        worst = row.worst("ours")
        out += [
            at_most(f"{row.body}, {words}", scale * worst[name], limit, unit)
            for name, (scale, limit, words, unit) in ASKED.items()
        ]
    if rows:
        milliseconds = float(np.median([row.milliseconds for row in rows]))
        out.append(at_most("a frame, median", milliseconds, MOST_MILLISECONDS, "ms"))
    if replays:
        out.append(at_most("beyond a joint limit", max(row["beyond"] for row in replays), 0.0, "rad"))
        nearest = min(row["clearance"] for row in replays)
        out.append(at_most("nearer to itself than is kept", 1000.0 * max(KEPT - nearest, 0.0), 0.0, "mm"))
        out.append(
            at_most(
                "fastest joint",
                max(row["step"] for row in replays),
                float(np.max(MotionLimits().velocity)) + 1e-6,
                "rad/s",
            )
        )
    return out


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one body, one seed, some clips")
    parser.add_argument("--replays", action="store_true", help="recorded motion on the robot alone")
    parser.add_argument("--tuning", action="store_true", help="the people that the chain was made with instead")
    parser.add_argument("--material", type=Path, metavar="FOLDER", help="keep what was rendered and found here")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers")
    parser.add_argument("--chart", type=Path, metavar="FILE", help="draw the errors, PNG or SVG")
    options = parser.parse_args(arguments)
    data = Path(os.environ.get("IK_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    console = Console(width=max(Console().width, 170))
    if options.replays:
        return _replays_alone(data / "human", options, console)
    if not (data / "camera" / "human.npz").is_file():
        parser.error(f"no person to render in {data}; set IK_DATA to the folder of the data")
    chosen = takes(fresh=not options.tuning)
    if options.quick:
        chosen = chosen[:2]
    seeds = list(SEEDS[:1] if options.quick else SEEDS)
    rows: list[Danced] = []
    keeping = tempfile.TemporaryDirectory() if options.material is None else nullcontext(str(options.material))
    try:
        with keeping as folder, Progress(console=console, transient=True) as progress:
            Path(folder).mkdir(parents=True, exist_ok=True)
            for take in chosen:
                task = progress.add_task(take.name, total=round(take.dance.duration * FPS))
                material = rendered(take, data / "camera", Path(folder), lambda task=task: progress.advance(task))
                rows.append(danced(take, material, seeds))
                progress.remove_task(task)
            task = progress.add_task("what remains")
            first = rendered(chosen[0], data / "camera", Path(folder), lambda: None)
            remains = budget(chosen[0], first, seeds[0])
            progress.update(task, description="recorded motion")
            recorded = (data / "human" / "smpl").is_dir()
            replays = list(replayed(data / "human", options.quick)) if recorded else []
            bent = list(replayed_bent(data / "human")) if recorded and not options.quick else []
    except (ModelError, NoMediaPipe, NoRendering) as error:
        print(f"camera: {error}", file=sys.stderr)
        return 1
    console.print(dances_table(rows))
    for name, score in remains.items():
        console.print(f"{chosen[0].subject.name}, {name}: {score}", soft_wrap=True)
    console.print(f"a frame takes {np.median([row.milliseconds for row in rows]):.2f} ms (median)")
    console.print(replay_table(replays))
    judged = verdicts(rows, replays)
    document = {
        "kind": "camera",
        "environment": environment(PACKAGES),
        "fresh": not options.tuning,
        "seeds": seeds,
        "asked": {name: list(what) for name, what in ASKED.items()},
        "names": NAMES,
        "dances": [row.document() for row in rows],
        "budget": {"body": chosen[0].subject.name, "scores": {name: asdict(score) for name, score in remains.items()}},
        "replays": replays,
        "bent": bent,
        "elbow_like": ELBOW_LIKE,
        "verdicts": verdict_documents(judged),
    }
    save(document, options.json, options.chart, console, script=CHART_SCRIPT)
    return judge(judged, console)


def _replays_alone(folder: Path, options: argparse.Namespace, console: Console) -> int:
    """Measure and judge recorded motion on the robot, and nothing else."""
    if not (folder / "smpl").is_dir():
        print(f"camera: no recorded people in {folder}; set IK_DATA to the folder of the data", file=sys.stderr)
        return 1
    replays = list(replayed(folder, options.quick))
    console.print(replay_table(replays))
    judged = verdicts([], replays)
    document = {
        "kind": "camera",
        "environment": environment(PACKAGES),
        "replays": replays,
        "bent": [] if options.quick else list(replayed_bent(folder)),
        "elbow_like": ELBOW_LIKE,
        "verdicts": verdict_documents(judged),
    }
    save(document, options.json, None, console)
    return judge(judged, console)


if __name__ == "__main__":
    sys.exit(main())
