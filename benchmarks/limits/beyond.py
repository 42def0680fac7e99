"""Targets out of reach: no chatter beyond the boundary, no lurch on the way back, and exact again when back."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.limits.geometry import wrist_errors
from benchmarks.limits.paths import JointPath, clear_path, follow
from benchmarks.limits.precision import POSITION_MM, ROTATION_DEG
from benchmarks.limits.rig import Result, Rig, Row, Tell, at_most, shown
from benchmarks.workloads import OUT_OF_REACH, PERIOD, unreachable
from ik_service.problem import Collision
from ik_service.robot import Robot

TITLE = "beyond reach"

STEP = 0.04
"""Asked of the largest step of a joint from one frame to the next [rad]."""

TORN = 0.3
"""A step on the way out and back that counts as a lurch [rad]. The limit above does not apply there: an elbow that
leaves the straight posture for a target a few millimetres nearer has to bend by a tenth of a radian."""

FRAMES = 500
CYCLE = 10.0
"""Time of one excursion out of reach and back [s]."""

SETTLED = 0.5
"""Time after which an arm that is back within reach has to be exact [s]."""

SETTINGS: tuple[Collision, ...] = ("off", "avoid")


def measure(rig: Rig, tell: Tell) -> Result:
    """Follow targets that are out of reach all along, and others that leave it and come back."""
    robot, frames = rig.robot, min(FRAMES, rig.sizes.frames or FRAMES)
    always = unreachable(robot, frames)
    start = np.tile(always.first, (frames, 1))
    beyond = JointPath("unreachable", start, always.left, always.right, 1.0 / PERIOD, np.zeros(frames, dtype=bool))
    trips = [excursion(rig, 1000, seed) for seed in range(rig.sizes.paths)]
    total, done = len(SETTINGS) * (len(beyond) + sum(map(len, trips))), 0

    def advance(count: int) -> None:
        nonlocal done
        done += count
        tell(done, total)

    rows: list[Row] = []
    numbers: dict[str, Any] = {}
    for setting in SETTINGS:
        told = follow(rig.precise, beyond, setting, advance=advance)
        back = [follow(rig.precise, trip, setting, advance=advance) for trip in trips]
        numbers[setting] = {
            "unreachable": _steps([told]) | _errors(robot, beyond, told),
            "out and back": _steps(back) | _after(robot, trips, back),
        }
        rows += _rows(setting, numbers[setting])
    return Result(rows, numbers)


def excursion(rig: Rig, frames: int, seed: int) -> JointPath:
    """Slow motion whose targets move away from the shoulders until they are out of reach, and come back.

    They are stretched by up to `OUT_OF_REACH` times the arm's length. Its `inside` says which frames are as far from
    the shoulder as in the clear path that it is made of: these can be reached.
    """
    path = clear_path(rig.robot, rig.distances, frames, seed)
    phase = np.arange(frames) * PERIOD / CYCLE
    away = np.maximum(np.sin(2.0 * np.pi * phase), 0.0) ** 2  # half of the time back
    targets = []
    for T, arm in zip((path.left, path.right), rig.robot.arms, strict=True):
        apart = T[:, :3, 3] - arm.shoulder
        distance = np.linalg.norm(apart, axis=1)
        stretched = distance + away * (OUT_OF_REACH * arm.reach - distance)
        moved = T.copy()
        moved[:, :3, 3] = arm.shoulder + apart * (stretched / distance)[:, None]
        targets.append(moved)
    return JointPath(f"excursion {seed}", path.q, *targets, path.fps, away == 0.0)


def _steps(paths: Sequence[np.ndarray]) -> dict[str, Any]:
    steps = np.concatenate([np.abs(np.diff(q, axis=0)).max(axis=1) for q in paths])
    p99 = float(np.percentile(steps, 99))
    return {"step_rad": {"p99": p99, "max": float(steps.max())}, "torn_frames": int((steps > TORN).sum())}


def _errors(robot: Robot, path: JointPath, q: np.ndarray) -> dict[str, Any]:
    position, rotation = wrist_errors(robot, q, path.left, path.right)
    return {"mm": {"p50": 1e3 * float(np.median(position))}, "deg": {"p50": float(np.rad2deg(np.median(rotation)))}}


def _after(robot: Robot, trips: Sequence[JointPath], answers: Sequence[np.ndarray]) -> dict[str, Any]:
    """Errors in frames that have been within reach for `SETTLED`."""
    wait = round(SETTLED / PERIOD)
    position, rotation = [], []
    for trip, q in zip(trips, answers, strict=True):
        settled = np.convolve(trip.inside, np.ones(wait), "full")[: len(trip)] >= wait
        errors = wrist_errors(robot, q, trip.left, trip.right)
        position.append(1e3 * errors[0][settled])
        rotation.append(np.rad2deg(errors[1][settled]))
    mm, deg = np.concatenate(position), np.concatenate(rotation)
    return {"frames_back": len(mm), "mm": {"p99": _p99(mm)}, "deg": {"p99": _p99(deg)}}


def _p99(values: np.ndarray) -> float:
    return float(np.percentile(values, 99)) if len(values) else float("nan")


def _rows(setting: str, numbers: dict[str, Any]) -> list[Row]:
    out, back = numbers["unreachable"], numbers["out and back"]
    # Free of collisions the way back is exact; an arm that avoids them may have folded around the body meanwhile.
    exact = setting == "off"
    return [
        at_most(f"unreachable, {setting}: largest joint step a frame", out["step_rad"]["max"], STEP, "rad"),
        shown(f"unreachable, {setting}: distance left, median", out["mm"]["p50"], "mm"),
        shown(f"out and back, {setting}: largest joint step a frame", back["step_rad"]["max"], "rad"),
        at_most(f"out and back, {setting}: steps above {TORN} rad", back["torn_frames"], 0, "", exact),
        at_most(f"back for {SETTLED} s, {setting}: position p99", back["mm"]["p99"], POSITION_MM, "mm", exact),
        at_most(f"back for {SETTLED} s, {setting}: rotation p99", back["deg"]["p99"], ROTATION_DEG, "°", exact),
    ]
