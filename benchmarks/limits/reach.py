"""Mode `reach` on random reachable, collision-free targets from random starts: how many are reached, and how fast."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.limits.geometry import wrist_errors, wrists
from benchmarks.limits.paths import clear_postures
from benchmarks.limits.rig import Result, Rig, Row, Tell, at_least, at_most, shown
from benchmarks.limits.timing import in_turns
from ik_proto.limits import DEFAULT_STARTS
from ik_service.solution import Solution

TITLE = "global solves, mode reach, collisions avoided"

POSITION_MM, ROTATION_DEG = 0.1, 0.1
SHARE_PERCENT = 99.99
P50_US, P99_US = 150.0, 1000.0
BUDGETS = (1, 2, 4, 8, 16, 32, 64, 128)
SEED = 11
TOUCH = 1e-9
"""How far below the margin an answer counts as clear [m]: rounding of two ways to work out a distance."""


def measure(rig: Rig, tell: Tell) -> Result:
    """Solve all targets with the default budget of starts, and some of them with others."""
    robot, sizes = rig.robot, rig.sizes
    rng = np.random.default_rng(SEED)
    postures = clear_postures(robot, rig.distances, sizes.targets, rng)
    left, right = wrists(robot, postures)
    starts = rng.uniform(robot.lower, robot.upper, postures.shape)
    few = min(sizes.budget_targets, sizes.targets)
    total, done = sizes.targets + few * len(BUDGETS), 0

    def advance(count: int) -> None:
        nonlocal done
        done += count
        tell(done, total)

    def solve(budgets: Sequence[int], count: int) -> dict[str, dict[str, Any]]:
        answers: dict[str, dict[int, Solution]] = {str(budget): {} for budget in budgets}

        def call(budget: int) -> Callable[[int], None]:
            mine = answers[str(budget)]

            def one(k: int) -> None:
                mine[k] = rig.precise.solve(left[k], right[k], starts[k], mode="reach", starts=budget)

            return one

        calls = {str(budget): call(budget) for budget in budgets}
        times = in_turns(calls, count, lambda solved: advance(solved * len(budgets)))
        given = left[:count], right[:count], starts[:count]
        return {key: _summary(rig, list(answers[key].values()), times[key], *given) for key in answers}

    whole = solve([DEFAULT_STARTS], sizes.targets)[str(DEFAULT_STARTS)]
    budgets = solve(BUDGETS, few)
    title = f"{sizes.targets} targets, {DEFAULT_STARTS} starts"
    rows = [
        at_least(
            f"{title}: within {POSITION_MM} mm, {ROTATION_DEG}° and clear", whole["success_percent"], SHARE_PERCENT, "%"
        ),
        at_most(f"{title}: answers with a pair nearer than margin and start", len(whole["closed"]), 0, ""),
        at_most(f"{title}: time p50", whole["us"]["p50"], P50_US, "µs", judged=False),
        at_most(f"{title}: time p99", whole["us"]["p99"], P99_US, "µs", judged=False),
        shown(f"{title}: most starts tried", whole["starts_tried"]["max"], ""),
        *(_budget_row(budget, numbers) for budget, numbers in budgets.items()),
    ]
    return Result(rows, {"seed": SEED, "starts": DEFAULT_STARTS, **whole, "budgets": budgets})


def _summary(
    rig: Rig, answers: Sequence[Solution], times: np.ndarray, left: np.ndarray, right: np.ndarray, starts: np.ndarray
) -> dict[str, Any]:
    """What became of the targets."""
    count, margin = len(answers), rig.robot.collision.margin
    q = np.array([answer.q for answer in answers])
    position, rotation = wrist_errors(rig.robot, q, left, right)
    d_start, d = rig.distances.pairs(starts), rig.distances.pairs(q)
    clear = d.min(axis=1) >= margin - TOUCH
    closed = (d < np.minimum(d_start, margin) - TOUCH).any(axis=1)
    reached = (1e3 * position <= POSITION_MM) & (np.rad2deg(rotation) <= ROTATION_DEG)
    p50, p90, p99 = np.percentile(times, (50, 90, 99)).tolist()
    tried = [answer.starts for answer in answers]
    return {
        "targets": count,
        "success_percent": 100.0 * float((reached & clear).mean()),
        "failed": np.flatnonzero(~(reached & clear)).tolist(),
        "not_clear": np.flatnonzero(~clear).tolist(),
        "closed": np.flatnonzero(closed).tolist(),
        "us": {"p50": p50, "p90": p90, "p99": p99, "max": float(times.max())},
        "mm": {"p50": 1e3 * float(np.median(position)), "max": 1e3 * float(position.max())},
        "won_by": dict(sorted(Counter(answer.start for answer in answers).items())),
        "starts_tried": {"p50": float(np.median(tried)), "max": max(tried)},
    }


def _budget_row(budget: str, numbers: dict[str, Any]) -> Row:
    us = numbers["us"]
    outcome = f"{numbers['success_percent']:.5g} %, p50 {us['p50']:.0f} µs, p99 {us['p99']:.0f} µs"
    return Row(f"{numbers['targets']} targets, at most {budget} starts", outcome)
