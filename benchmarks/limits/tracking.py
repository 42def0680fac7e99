"""Time of one call of `precise` along a smooth path, with collisions off, reported and avoided."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from benchmarks.limits.paths import JointPath, clear_path
from benchmarks.limits.rig import Result, Rig, Row, Tell, at_most, shown
from benchmarks.limits.timing import in_turns
from benchmarks.workloads import PERIOD, tracking
from ik_service.problem import Collision

TITLE = "tracking time, both arms"

SETTINGS: tuple[Collision, ...] = ("off", "report", "avoid")
ASKED_US = {"off": 7.0, "avoid": 30.0}
FRAMES = 2000
SHARE = 0.8
"""Of the joint ranges; that of the workload `tracking`."""

CLEAR_SEED = 1


def measure(rig: Rig, tell: Tell) -> Result:
    """Time the workload `tracking`, and a path like it that is clear of collisions."""
    frames, rounds = min(FRAMES, rig.sizes.frames or FRAMES), rig.sizes.rounds
    paths = {"tracking": as_path(rig, frames), "clear": clear_path(rig.robot, rig.distances, frames, CLEAR_SEED, SHARE)}
    rows: list[Row] = []
    numbers: dict[str, Any] = {}
    done = 0

    def advance(count: int) -> None:
        nonlocal done
        done += count
        tell(done, len(paths) * rounds * frames)

    for name, path in paths.items():
        inside = rig.distances.clearance(path.q) >= rig.robot.collision.margin
        starts = {setting: _starts(rig, path, setting) for setting in SETTINGS}
        found = []
        for _ in range(rounds):
            calls: dict[str, Callable[[int], None]] = {
                setting: _call(rig, path, starts[setting], setting) for setting in SETTINGS
            }
            found.append(in_turns(calls, len(path), advance))
        numbers[name] = {
            "frames": len(path),
            "clear_percent": 100.0 * float(inside.mean()),
            **{setting: _summary([times[setting] for times in found]) for setting in SETTINGS},
        }
        rows += _rows(name, numbers[name])
    return Result(rows, numbers)


def as_path(rig: Rig, frames: int) -> JointPath:
    """The workload `tracking` as a path. Its postures are those of the answers without collisions."""
    workload = tracking(rig.robot, frames)
    q, postures = workload.first, np.empty((frames, rig.robot.nq))
    for k in range(frames):
        postures[k] = q = rig.precise.solve(workload.left[k], workload.right[k], q, collision="off").q
    return JointPath("tracking", postures, workload.left, workload.right, 1.0 / PERIOD, np.ones(frames, dtype=bool))


def _starts(rig: Rig, path: JointPath, setting: Collision) -> np.ndarray:
    """What every request of the path starts from: the answer to the one before."""
    starts = np.empty_like(path.q)
    starts[0] = path.q[0]
    for k in range(len(path) - 1):
        starts[k + 1] = rig.precise.solve(path.left[k], path.right[k], starts[k], collision=setting).q
    return starts


def _call(rig: Rig, path: JointPath, starts: np.ndarray, setting: Collision) -> Callable[[int], None]:
    solve, left, right = rig.precise.solve, list(path.left), list(path.right)
    rows = list(starts)

    def call(k: int) -> None:
        solve(left[k], right[k], rows[k], collision=setting)

    return call


def _summary(rounds: list[np.ndarray]) -> dict[str, Any]:
    """Percentiles of the quietest round, and medians of all."""
    p50, p99 = np.percentile(np.array(rounds), (50, 99), axis=1)
    return {
        "us": {"p50": float(p50.min()), "p99": float(p99.min())},
        "rounds_us": {"p50": p50.tolist(), "p99": p99.tolist()},
    }


def _rows(name: str, numbers: Mapping[str, Any]) -> list[Row]:
    where = f"{name} ({numbers['clear_percent']:.0f} % of the frames clear)"
    rows = []
    for setting in SETTINGS:
        us = numbers[setting]["us"]
        what = f"{where}, {setting}: time"
        if setting in ASKED_US:
            rows.append(at_most(f"{what} p50", us["p50"], ASKED_US[setting], "µs", judged=False))
        else:
            rows.append(shown(f"{what} p50", us["p50"], "µs"))
        rows.append(shown(f"{what} p99", us["p99"], "µs"))
    return rows
