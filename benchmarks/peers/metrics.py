"""Numbers that describe a run.

A frame is a success when both wrists are within 1 mm and 1 degree of their targets. A step is the largest change of
any joint from one frame to the next; more than 0.3 rad at 50 Hz is 15 rad/s, a torn path.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.peers.driver import Run
from benchmarks.workloads import Workload
from ik_service.robot import Robot

SUCCESS_POSITION = 1e-3
SUCCESS_ROTATION = np.deg2rad(1.0)
TORN = 0.3
LIMIT_SLACK = 1e-4
"""How far beyond a limit counts as a violation [rad]: more than the tolerance of any quadratic-program solver here."""


def summary(
    robot: Robot,
    workloads: Sequence[Workload],
    run: Run,
    baseline: Run | None,
    clearance: Callable[[np.ndarray], np.ndarray] | None = None,
) -> dict[str, Any]:
    """Describe a run.

    Args:
        robot: The robot.
        workloads: What was run.
        run: What came out.
        baseline: The run whose times are the unit of `ratio`.
        clearance: Measures self-clearance [m] of joint positions; None to leave it out.

    Returns:
        A JSON-ready mapping; keys carry their units.
    """
    frames = [
        robot.wrist_errors(q, left, right)
        for workload, answers in zip(workloads, run.answers, strict=True)
        for left, right, q in zip(workload.left, workload.right, answers, strict=True)
    ]
    position, rotation = (np.array(errors).max(axis=1) for errors in zip(*frames, strict=True))
    reached = (position < SUCCESS_POSITION) & (rotation < SUCCESS_ROTATION)
    q = np.concatenate(run.answers)
    beyond = np.maximum(robot.lower - q, q - robot.upper).max(axis=1)
    times = np.concatenate(run.times)
    result = {
        "frames": len(q),
        "us": _percentiles(times, 50, 95, 99),
        "success_percent": 100.0 * float(reached.mean()),
        "position_error_mm": _percentiles(1e3 * position, 50, 99),
        "rotation_error_deg": _percentiles(np.rad2deg(rotation), 50, 99),
        "limit_violations": int((beyond > LIMIT_SLACK).sum()),
        "largest_violation_rad": float(max(0.0, beyond.max())),
        "raised": run.raised,
    }
    if baseline is not None:
        result["ratio"] = ratio(run, baseline)
    if all(workload.starts is None for workload in workloads):
        result |= _steps(run.answers)
    if clearance is not None:
        result["smallest_clearance_mm"] = 1e3 * float(clearance(q).min())
    return result


def ratio(run: Run, baseline: Run) -> float:
    """How many times longer a call takes: median over the turns of the ratio of medians."""
    turns = zip(run.times, baseline.times, strict=True)
    return float(np.median([np.median(ours) / np.median(unit) for ours, unit in turns]))


def _steps(answers: Sequence[np.ndarray]) -> dict[str, Any]:
    """Steps from one answer of a path to the next."""
    steps = np.concatenate([np.abs(np.diff(q, axis=0)).max(axis=1) for q in answers])
    return {
        "step_rad": _percentiles(steps, 50, 99) | {"max": float(steps.max())},
        "torn_frames": int((steps > TORN).sum()),
    }


def _percentiles(values: np.ndarray, *percents: int) -> dict[str, float]:
    return {f"p{p}": float(value) for p, value in zip(percents, np.percentile(values, percents), strict=True)}
