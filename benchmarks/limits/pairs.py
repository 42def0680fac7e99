"""How the time of a call grows with the number of checked pairs: one kernel for each number."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.limits.paths import JointPath, clear_path
from benchmarks.limits.rig import Result, Rig, Row, Tell
from benchmarks.limits.timing import in_turns
from benchmarks.limits.tracking import CLEAR_SEED, SHARE
from ik_service.collision import CollisionModel
from ik_service.kernel import load_kernel
from ik_service.problem import Collision
from ik_service.solver import Solver

TITLE = "time against pairs"

SETTINGS: tuple[Collision, ...] = ("report", "avoid")
FRAMES = 1000
ORDER_SEED = 3


def measure(rig: Rig, tell: Tell) -> Result:
    """Time a clear path with none, some, and all of the pairs."""
    model, preset = rig.robot.collision, rig.precise.preset
    frames = min(FRAMES, rig.sizes.frames or FRAMES)
    path = clear_path(rig.robot, rig.distances, frames, CLEAR_SEED, SHARE)
    order = np.random.default_rng(ORDER_SEED).permutation(len(model.pairs))
    counts = np.linspace(0, len(order), rig.sizes.pair_points).round().astype(int).tolist()
    calls: dict[str, Callable[[int], None]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        cache = Path(scratch)  # private to this user, as the cache of kernels has to be
        for done, count in enumerate(counts):
            robot = rig.robot.copy()
            robot.collision = thinned(model, np.sort(order[:count]).tolist())
            solver = Solver(robot, load_kernel(robot, rig.kernel.kind == "c", cache), preset)
            calls |= {f"{count} {setting}": _call(solver, path, setting) for setting in SETTINGS}
            tell(done + 1, len(counts) + rig.sizes.rounds)
    found = []
    for turn in range(rig.sizes.rounds):
        found.append(in_turns(calls, frames))
        tell(len(counts) + turn + 1, len(counts) + rig.sizes.rounds)
    p50 = {name: float(min(np.median(times[name]) for times in found)) for name in calls}
    numbers = {setting: {str(count): p50[f"{count} {setting}"] for count in counts} for setting in SETTINGS}
    rows = [
        Row(f"{setting}: time p50", ", ".join(f"{us:.1f} µs at {count}" for count, us in numbers[setting].items()))
        for setting in SETTINGS
    ]
    return Result(rows, {"us_p50": numbers, "frames": frames})


def thinned(model: CollisionModel, kept: list[int]) -> CollisionModel:
    """A model that checks only the pairs in these places, given in order."""
    left = sum(place in model.left for place in kept)
    right = left + sum(place in model.right for place in kept)
    return replace(
        model,
        pairs=tuple(model.pairs[place] for place in kept),
        left=range(left),
        right=range(left, right),
        across=range(right, len(kept)),
    )


def _call(solver: Solver, path: JointPath, setting: Collision) -> Callable[[int], None]:
    left, right, q = list(path.left), list(path.right), list(path.q)

    def call(k: int) -> None:
        solver.solve(left[k], right[k], q[k - 1 if k else 0], collision=setting)

    return call
