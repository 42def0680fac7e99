"""The solver against the seeds' Ipopt formulation, side by side in one run, through the public API.

Frames go in blocks: each block is given to generated C, to the virtual machine and to the reference with the seeds'
options, one after the other, so that what else the machine does falls on all of them alike, and each runs with warm
caches. Times are wall time around one Python call: targets in, joints out, both arms, gravity torques included for
ours. The CPU speed-up compares CPU time, which a busy machine distorts less.

Like for like: preset `openwbt`, which is the seeds' cost, and collisions ignored, as they ignore them. What `precise`
and avoidance reach and cost is in `solver_limits.py`.

Costs are compared with a fourth solver, the reference at tolerance 1e-10 without Ipopt's relaxation of the limits,
from the same start, and are computed for all by one function.

    OMP_NUM_THREADS=1 python benchmarks/solver_vs_reference.py [--quick] [--json FILE]

The exit code is 1 when an accuracy target is missed. Speed is reported, not judged: it depends on the machine.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.workloads import Workload, cold, tracking, unreachable
from ik_proto import Status
from ik_proto.robots import load_description
from ik_service.kernel import load_kernel
from ik_service.preset import Preset
from ik_service.reference import Reference
from ik_service.robot import Robot
from ik_service.solver import Solver

TIGHT = {"max_iter": 500, "tol": 1e-10, "print_level": 0, "bound_relax_factor": 0.0}
PACKAGES = ("ik-service", "casadi", "pin", "numpy")
BLOCK = 25
"""Frames a solver gets in one go."""

PERCENTILES = (50, 95, 99)

Solve = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Target:
    """What a workload demands of the cost.

    Attributes:
        excess: Relative excess over Ipopt's cost that counts as worse.
        share: Largest share of frames that may be worse.
    """

    excess: float
    share: float


TARGETS = {"tracking": Target(1e-8, 0.0), "unreachable": Target(1e-6, 0.0), "cold": Target(1e-2, 0.02)}


class Bench:
    """The solvers and the workloads."""

    def __init__(self, robot_name: str) -> None:
        description = load_description(robot_name)
        self.robot = Robot.load(description)
        preset = Preset.of(description, "openwbt")
        self.compiled = load_kernel(self.robot)
        self.c = Solver(self.robot, self.compiled, preset)
        self.vm = Solver(self.robot, load_kernel(self.robot, compiled=False), preset)
        self.seed = Reference(self.robot, preset)
        self.tight = Reference(self.robot, preset, TIGHT)

    def run(self, workload: Workload, progress: Callable[[int], None]) -> dict[str, Any]:
        """Measure one workload."""
        solvers, frames = self._solvers(), len(workload)
        times = {name: np.zeros(frames) for name in solvers}
        cpu: dict[str, list[float]] = {name: [] for name in solvers}
        excess = {name: np.zeros(frames) for name in solvers}
        statuses = dict.fromkeys((Status.OK, Status.UNREACHABLE, Status.NOT_CONVERGED), 0)
        violations, q = 0, workload.first
        for begin in range(0, frames, BLOCK):
            block = range(begin, min(begin + BLOCK, frames))
            starts = {}
            for k in block:
                starts[k] = workload.start(k, q)
                ours = self.c.solve(workload.left[k], workload.right[k], starts[k], collision="off")
                statuses[ours.status] += 1
                violations += bool((ours.q < self.robot.lower).any() or (ours.q > self.robot.upper).any())
                q = ours.q
            answers = {}
            for name, solve in solvers.items():
                cpu_before = time.process_time_ns()
                for k in block:
                    before = time.perf_counter_ns()
                    answers[name, k] = solve(workload.left[k], workload.right[k], starts[k])
                    times[name][k] = (time.perf_counter_ns() - before) / 1e3
                cpu[name].append((time.process_time_ns() - cpu_before) / 1e3 / len(block))
            for k in block:
                targets = workload.left[k], workload.right[k]
                best = self._cost(self.tight.solve(*targets, starts[k])[0], starts[k], *targets)
                for name in solvers:
                    excess[name][k] = (self._cost(answers[name, k], starts[k], *targets) - best) / best
            progress(block.stop)
        return {
            "frames": frames,
            "limit_violations": violations,
            "statuses": {status.value: count for status, count in statuses.items()},
            "solvers": {
                name: {
                    **_summary(times[name], excess[name], TARGETS[workload.name]),
                    "cpu_us": float(np.median(cpu[name])),
                    "speed_up": float(np.median(times["reference"]) / np.median(times[name])),
                    "cpu_speed_up": float(np.median(cpu["reference"]) / np.median(cpu[name])),
                }
                for name in solvers
            },
        }

    def _solvers(self) -> dict[str, Solve]:
        def ours(solver: Solver) -> Solve:
            return lambda left, right, q: solver.solve(left, right, q, collision="off").q

        return {
            self.compiled.kind: ours(self.c),
            "vm": ours(self.vm),
            "reference": lambda left, right, q: self.seed.solve(left, right, q)[0],
        }

    def _cost(self, q: np.ndarray, q_last: np.ndarray, left: np.ndarray, right: np.ndarray) -> float:
        inside = np.clip(q, self.robot.lower, self.robot.upper)
        return float(self.tight.objective(inside, q_last, left, right))


def _summary(times: np.ndarray, excess: np.ndarray, target: Target) -> dict[str, Any]:
    percentiles = np.percentile(times, PERCENTILES)
    return {
        "us": {f"p{p}": float(value) for p, value in zip(PERCENTILES, percentiles, strict=True)},
        "largest_excess": float(excess.max()),
        "worse_share": float(np.mean(excess > target.excess)),
        "better_share": float(np.mean(excess < -0.01)),
        "meets_target": bool(np.mean(excess > target.excess) <= target.share),
    }


def _table(results: dict[str, dict[str, Any]]) -> Table:
    table = Table(title="one call, both arms [µs]; cost against Ipopt at 1e-10 from the same start")
    for column in (
        "workload",
        "solver",
        "p50",
        "p95",
        "p99",
        "speed-up",
        "CPU",
        "largest excess",
        "worse",
        "better 1 %",
    ):
        table.add_column(column, justify="left" if column in ("workload", "solver") else "right")
    for name, result in results.items():
        for solver, row in result["solvers"].items():
            table.add_row(
                f"{name} ({result['frames']})",
                solver,
                *(f"{row['us'][f'p{p}']:.1f}" for p in PERCENTILES),
                f"{row['speed_up']:.0f}x",
                f"{row['cpu_speed_up']:.0f}x",
                f"{row['largest_excess']:.1e}",
                f"{100 * row['worse_share']:.1f} %",
                f"{100 * row['better_share']:.1f} %",
            )
        table.add_section()
    return table


def _faults(results: dict[str, dict[str, Any]]) -> list[str]:
    faults = []
    for name, result in results.items():
        faults += [
            f"{name}: the cost target is missed by {solver}"
            for solver, row in result["solvers"].items()
            if solver != "reference" and not row["meets_target"]
        ]
        if result["limit_violations"]:
            faults.append(f"{name}: {result['limit_violations']} answers beyond the limits")
    return faults


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description="The solver against the seeds' Ipopt formulation.")
    parser.add_argument("--quick", action="store_true", help="a tenth of the frames")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers to FILE")
    parser.add_argument("--robot", default="g1", help="robot description (default: g1)")
    arguments = parser.parse_args()
    console = Console() if sys.stdout.isatty() else Console(width=120)
    bench = Bench(arguments.robot)
    if bench.compiled.note:
        console.print(f"kernel: {bench.compiled.note}")
    share = 10 if arguments.quick else 1
    workloads = [
        make(bench.robot, frames // share) for make, frames in ((tracking, 2000), (unreachable, 500), (cold, 500))
    ]
    results = {}
    with Progress(console=console, transient=True) as progress:
        for workload in workloads:
            task = progress.add_task(workload.name, total=len(workload))

            def advance(done: int, task: TaskID = task) -> None:
                progress.update(task, completed=done)

            results[workload.name] = bench.run(workload, advance)
    console.print(_table(results))
    for name, result in results.items():
        counts = ", ".join(f"{count} {status}" for status, count in result["statuses"].items())
        worse = f"worse means more than {TARGETS[name].excess:g} above"
        console.print(f"{name}: {counts}, {result['limit_violations']} limit violations; {worse}")
    if arguments.json:
        report = {"environment": environment(PACKAGES), "kernel": bench.compiled.kind, "results": results}
        arguments.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    faults = _faults(results)
    for fault in faults:
        console.print(fault, style="red")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
