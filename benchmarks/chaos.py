"""Two hundred times something is killed, stopped or restarted while the robot moves. Does it ever move as it must not?

    python benchmarks/chaos.py [--cycles 200] [--seed 0] [--keep FOLDER] [--json FILE] [--chart FILE]

Service, simulated robot and operator are processes of their own. While the operator's hands lead the arms along a path,
SIGKILL, SIGSTOP for up to two seconds, or SIGTERM hits the service or the operator at a random instant; what ended is
started again, and the operator grips anew. The robot's own end records every control tick. Afterwards that record is
held against the bounds of motion and against the operator's diary of grips (benchmarks/faults/audit.py).

A cycle takes about four seconds. Exit code 1: something moved, sagged or ended as it must not.
"""

import argparse
import os
import statistics
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.faults.audit import SAG_LIMIT, Audit, audit
from benchmarks.faults.plan import plan
from benchmarks.faults.trace import Done, RobotTrace, grips
from benchmarks.faults.world import Lost, World
from benchmarks.load.results import Verdict, at_most, judge, save, verdict_documents
from ik_client.joint_limiter import MotionLimits

PACKAGES = ("ik-service", "mujoco", "ruckig", "numpy")
EXCERPT_S = 40.0
"""How much of the record goes into the chart [s]."""


def recovery(done: Sequence[Done]) -> dict[str, list[float]]:
    """How long it took until the robot followed again, by what was done [s]."""
    found = defaultdict(list)
    for one in done:
        found[f"{one.fault.kind} {one.fault.victim}"].append(one.recovered - one.t)
    return dict(sorted(found.items()))


def table(done: Sequence[Done]) -> Table:
    """What was done, and how long it took to be over."""
    out = Table(title=f"{len(done)} faults while the robot moved", title_justify="left")
    for name in ("fault", "times", "median", "longest"):
        out.add_column(name, justify="left" if name == "fault" else "right")
    for what, seconds in recovery(done).items():
        out.add_row(what, str(len(seconds)), f"{statistics.median(seconds):.2f} s", f"{max(seconds):.2f} s")
    out.caption = "until the robot follows again; a process's own start and the operator's new grip are part of it"
    return out


def verdicts(found: Audit, faults: Sequence[str], cycles: int) -> list[Verdict]:
    """What was asked for."""
    limits = MotionLimits()
    whole = 1.0 + 1e-5
    return [
        at_most("largest velocity of a set-point", found.velocity / whole, float(limits.velocity), "rad/s"),
        at_most(
            "largest acceleration of a set-point", found.acceleration / whole, float(limits.acceleration), "rad/s²"
        ),
        at_most("sag of a joint at rest", found.sag, SAG_LIMIT, "rad"),
        Verdict(
            "faults after which the robot followed again", str(found.recovered), str(cycles), found.recovered == cycles
        ),
        at_most("violations", len(found.violations), 0),
        at_most("processes that ended otherwise than asked", len(faults), 0),
    ]


def excerpt(trace: RobotTrace, done: Sequence[Done]) -> dict[str, Any]:
    """The beginning of the record, JSON-ready."""
    kept = trace.t < trace.t[0] + EXCERPT_S
    speed = np.abs(trace.moved / trace.dt)
    return {
        "t_s": (trace.t[kept] - trace.t[0]).round(3).tolist(),
        "speed_rad_s": speed[kept].round(4).tolist(),
        "state": trace.state[kept].tolist(),
        "faults": [
            {"t_s": round(one.t - trace.t[0], 3), "what": str(one.fault)}
            for one in done
            if one.t < trace.t[0] + EXCERPT_S
        ],
    }


def document(
    found: Audit, trace: RobotTrace, done: Sequence[Done], judged: Sequence[Verdict], seed: int
) -> dict[str, Any]:
    """All of it, JSON-ready."""
    limits = MotionLimits()
    return {
        "kind": "chaos",
        "environment": environment(PACKAGES),
        "seed": seed,
        "cycles": len(done),
        "limits": {"velocity_rad_s": limits.velocity, "acceleration_rad_s2": limits.acceleration},
        "found": {
            "largest_step_rad": found.step,
            "velocity_rad_s": found.velocity,
            "acceleration_rad_s2": found.acceleration,
            "measured_velocity_rad_s": found.measured_velocity,
            "sag_rad": found.sag,
            "lag_rad": found.lag,
            "engagements": found.engagements,
            "faults_that_disarm": found.disarming,
        },
        "violations": found.violations,
        "recovery_s": recovery(done),
        "excerpt": excerpt(trace, done),
        "verdicts": verdict_documents(judged),
    }


def run(folder: Path, cycles: int, seed: int, progress: Progress) -> tuple[RobotTrace, list[Done], Audit, list[str]]:
    """Bring about the faults and look at what came of them."""
    task = progress.add_task("faults", total=cycles)
    with World(folder) as world:
        done = world.run(plan(cycles, seed), lambda count: progress.update(task, completed=count))
        trace, faults = world.end()
        return trace, done, audit(trace, done, grips(world.diary.entries)), faults


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the test."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=200, metavar="N", help="faults (200)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="decides whom, what and when (0)")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep logs, the robot's record and the diary there")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers")
    parser.add_argument("--chart", type=Path, metavar="FILE", help="draw an excerpt and the recovery times, PNG or SVG")
    options = parser.parse_args(arguments)
    if options.cycles < 1:
        parser.error("--cycles must be positive")
    console = Console(width=max(Console().width, 120))
    with tempfile.TemporaryDirectory() as scratch, Progress(console=console, transient=True) as progress:
        folder = options.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        try:
            trace, done, found, faults = run(folder, options.cycles, options.seed, progress)
        except Lost as error:
            progress.stop()
            print(f"chaos: {error}", file=sys.stderr)
            return 1
    console.print(table(done))
    console.print(
        f"{len(trace.t)} control ticks, {found.engagements} engagements; largest step of a set-point "
        f"{found.step * 1e3:.1f} mrad a tick; measured: up to {found.measured_velocity:.2f} rad/s, "
        f"{found.lag:.3f} rad from the set-point in motion",
        soft_wrap=True,
    )
    for line in [*found.violations, *faults]:
        console.print(line, style="red", soft_wrap=True)
    judged = verdicts(found, faults, options.cycles)
    save(document(found, trace, done, judged, options.seed), options.json, options.chart, console)
    return judge(judged, console)


if __name__ == "__main__":
    sys.exit(main())
