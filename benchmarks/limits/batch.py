"""Solves a second against the size of a batch, and one after the other."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.limits.paths import JointPath, clear_path
from benchmarks.limits.rig import Result, Rig, Row, Tell, at_least
from benchmarks.limits.tracking import CLEAR_SEED, SHARE, as_path
from ik_service.problem import Collision

TITLE = "batches, all cores"

SETTINGS: tuple[Collision, ...] = ("off", "avoid")
ASKED = {"off": 100_000.0, "avoid": 40_000.0}
ASKED_SIZE = 4096
FRAMES = 2000
LEAST_ROUNDS = 3
SINGLES = 512
"""Single solves timed as one, in the loop that a batch replaces."""


def measure(rig: Rig, tell: Tell) -> Result:
    """Measure steps along the workload `tracking`, and along a clear path like it."""
    frames = min(FRAMES, rig.sizes.frames or FRAMES)
    paths = {"tracking": as_path(rig, frames), "clear": clear_path(rig.robot, rig.distances, frames, CLEAR_SEED, SHARE)}
    rows: list[Row] = []
    numbers: dict[str, Any] = {}
    done, total = 0, len(paths) * len(SETTINGS) * (len(rig.sizes.batches) + 1)
    for name, path in paths.items():
        numbers[name] = {}
        for setting in SETTINGS:
            rates = numbers[name][setting] = {}
            for size in (0, *rig.sizes.batches):
                rates[str(size) if size else "loop"] = _rate(rig, path, setting, size)
                done += 1
                tell(done, total)
            outcome = ", ".join(f"{rate:,.0f} at {size}" for size, rate in rates.items())
            if (best := rates.get(str(ASKED_SIZE))) is not None:
                what = f"{name}, {setting}: solves a second, batch of {ASKED_SIZE}"
                rows.append(at_least(what, round(best), ASKED[setting], "/s", judged=False))
            rows.append(Row(f"{name}, {setting}: solves a second", outcome))
    return Result(rows, numbers)


def _rate(rig: Rig, path: JointPath, setting: Collision, size: int) -> float:
    """Solves a second: size by the median time of a batch; size 0 stands for the plain loop."""
    count = size or SINGLES
    # A step along the path a row: from the posture of a frame to the targets of the next.
    rows = np.arange(count) % (len(path) - 1)
    left, right, q = path.left[rows + 1], path.right[rows + 1], path.q[rows]
    run = _loop(rig, left, right, q, setting) if not size else _whole(rig, left, right, q, setting)
    run()
    times: list[float] = []
    end = time.perf_counter() + rig.sizes.batch_seconds
    while len(times) < LEAST_ROUNDS or time.perf_counter() < end:
        before = time.perf_counter()
        run()
        times.append(time.perf_counter() - before)
    return count / float(np.median(times))


def _whole(rig: Rig, left: np.ndarray, right: np.ndarray, q: np.ndarray, setting: Collision) -> Callable[[], object]:
    return lambda: rig.precise.solve_batch(left, right, q, collision=setting)


def _loop(rig: Rig, left: np.ndarray, right: np.ndarray, q: np.ndarray, setting: Collision) -> Callable[[], object]:
    rows = list(zip(left, right, q, strict=True))
    return lambda: [rig.precise.solve(*row, collision=setting) for row in rows]
