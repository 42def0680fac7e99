"""How exactly `precise` follows what can be followed, without flips, and how smoothly."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.clips import folder
from benchmarks.limits.geometry import wrist_errors
from benchmarks.limits.paths import JointPath, clear_path, follow, random_path, recorded
from benchmarks.limits.rig import Result, Rig, Row, Tell, at_most

TITLE = "precision along paths"

POSITION_MM, ROTATION_DEG = 0.5, 0.3
"""Asked of the 99th percentiles."""

FLIP, CALM = 0.3, 0.1
"""A step of more than the first where the path itself steps by less than the second is a flip [rad]."""

RECOVERY_S = 0.5
"""Time that an arm which the body held up gets to come back to its targets [s]."""

RANDOM_FRAMES = 1000
WHERE = {
    "off": "off, {} frames",
    "avoid": "avoid, {} clear frames",
    "recovered": f"avoid, {{}} frames clear for {RECOVERY_S} s",
}

SETTLING = 10
"""Frames at the beginning of a path that jerk leaves out: the filter starts with a step."""


def measure(rig: Rig, tell: Tell) -> Result:
    """Follow recordings and random paths with collisions off and avoided."""
    robot, sizes = rig.robot, rig.sizes
    frames = min(RANDOM_FRAMES, sizes.frames or RANDOM_FRAMES)
    groups: dict[str, list[JointPath]] = {
        "recorded": recorded(robot, sizes.frames),
        "random": [random_path(robot, frames, seed) for seed in range(sizes.paths)],
        "clear": [clear_path(robot, rig.distances, frames, seed) for seed in range(sizes.paths)],
    }
    total = sum(len(path) * (4 if name == "recorded" else 2) for name, group in groups.items() for path in group)
    done = 0

    def advance(count: int) -> None:
        nonlocal done
        done += count
        tell(done, total)

    rows: list[Row] = []
    numbers: dict[str, Any] = {}
    for name, group in groups.items():
        if not group:
            rows.append(Row(f"{name} motion: skipped, none in {folder()}", ""))
            continue
        off = [follow(rig.precise, path, "off", advance=advance) for path in group]
        avoid = [follow(rig.precise, path, "avoid", advance=advance) for path in group]
        everywhere = [np.ones(len(path), dtype=bool) for path in group]
        free = [path.inside & (rig.distances.clearance(path.q) >= robot.collision.margin) for path in group]
        numbers[name] = {
            "off": _errors(rig, group, off, everywhere) | {"flips": _flips(group, off)},
            "avoid": _errors(rig, group, avoid, free) | {"flips": _flips(group, avoid)},
            "recovered": _errors(rig, group, avoid, [_for_a_while(*one) for one in zip(free, group, strict=True)]),
        }
        rows += _rows(name, numbers[name])
        if name == "recorded":
            numbers["jerk"] = _jerks(rig, group, off, avoid, advance)
    if "jerk" in numbers:
        rows += _jerk_rows(numbers["jerk"])
    return Result(rows, numbers)


def _errors(
    rig: Rig, group: Sequence[JointPath], answers: Sequence[np.ndarray], counted: Sequence[np.ndarray]
) -> dict[str, Any]:
    """Errors of the worse wrist over the frames that count, of all paths together and of each."""
    per_path, all_position, all_rotation = {}, [], []
    for path, q, flags in zip(group, answers, counted, strict=True):
        position, rotation = (error[flags] for error in wrist_errors(rig.robot, q, path.left, path.right))
        all_position.append(1e3 * position)
        all_rotation.append(np.rad2deg(rotation))
        per_path[path.name] = _percentiles(all_position[-1], all_rotation[-1])
    return _percentiles(np.concatenate(all_position), np.concatenate(all_rotation)) | {"paths": per_path}


def _for_a_while(free: np.ndarray, path: JointPath) -> np.ndarray:
    """Frames that end `RECOVERY_S` of free frames; at the beginning of a path all before it count as free."""
    wait = round(RECOVERY_S * path.fps)
    return np.convolve(~free, np.ones(wait), "full")[: len(free)] == 0.0


def _percentiles(position: np.ndarray, rotation: np.ndarray) -> dict[str, Any]:
    result: dict[str, Any] = {"frames": len(position)}
    if len(position):
        for key, values in (("mm", position), ("deg", rotation)):
            p50, p99 = np.percentile(values, (50, 99)).tolist()
            result[key] = {"p50": p50, "p99": p99, "max": float(values.max())}
        result["missed"] = float(np.mean((position > POSITION_MM) | (rotation > ROTATION_DEG)))
    return result


def _flips(group: Sequence[JointPath], answers: Sequence[np.ndarray]) -> int:
    count = 0
    for path, q in zip(group, answers, strict=True):
        own, ours = (np.abs(np.diff(postures, axis=0)).max(axis=1) for postures in (path.q, q))
        count += int(((ours > FLIP) & (own < CALM)).sum())
    return count


def _rows(name: str, numbers: Mapping[str, Any]) -> list[Row]:
    rows = []
    for setting, judged in _judged(name).items():
        errors = numbers[setting]
        if not errors["frames"]:
            continue
        where = f"{name}, {WHERE[setting].format(errors['frames'])}"
        rows += [
            at_most(f"{where}: position p99", errors["mm"]["p99"], POSITION_MM, "mm", judged),
            at_most(f"{where}: rotation p99", errors["deg"]["p99"], ROTATION_DEG, "°", judged),
        ]
        if "flips" in errors:
            # An arm that the body held up may have far to go when it is free again, so flips are judged without it.
            calm = setting == "off" or name == "clear"
            rows.append(at_most(f"{name}, {setting}: flips", errors["flips"], 0, "", calm))
    return rows


def _judged(name: str) -> dict[str, bool]:
    """Which settings are shown for a group, and whether missing the numbers there is a failure.

    Random paths drive the arms through the body half of the time. Where they come out on the other side no arm can be
    that went around, so what the avoiding solver makes of them is shown; paths that are clear all along are judged.
    """
    if name == "clear":
        return {"off": True, "avoid": True}
    return {"off": True, "avoid": name == "recorded", "recovered": False}


def _jerks(
    rig: Rig, group: Sequence[JointPath], off: list[np.ndarray], avoid: list[np.ndarray], advance: Any
) -> dict[str, Any]:
    """Third differences of joint positions [rad/s^3] of the recordings and of what follows them, and how closely."""
    told = {
        "the recordings": [path.q for path in group],
        "openwbt, filtered": [follow(rig.openwbt, path, "off", True, advance) for path in group],
        "precise": off,
        "precise, avoid": avoid,
        "precise, filtered": [follow(rig.precise, path, "off", True, advance) for path in group],
    }
    result: dict[str, Any] = {}
    for name, paths in told.items():
        jerks = [_jerk(q, path.fps) for q, path in zip(paths, group, strict=True)]
        close = [wrist_errors(rig.robot, q, path.left, path.right)[0] for q, path in zip(paths, group, strict=True)]
        result[name] = _size(np.concatenate(jerks)) | {
            "mm": {"p50": 1e3 * float(np.median(np.concatenate(close)))},
            "paths": {path.name: _size(jerk) for path, jerk in zip(group, jerks, strict=True)},
        }
    return result


def _jerk(q: np.ndarray, fps: float) -> np.ndarray:
    return (np.diff(q, 3, axis=0) * fps**3)[SETTLING:]


def _size(jerk: np.ndarray) -> dict[str, float]:
    return {"rms": float(np.sqrt(np.mean(jerk**2))), "p99": float(np.percentile(np.abs(jerk), 99))}


def _jerk_rows(jerks: Mapping[str, Any]) -> list[Row]:
    own, seeds = jerks["the recordings"], jerks["openwbt, filtered"]
    outcome = f"{seeds['rms'] / own['rms']:.3g} x the recordings', {seeds['mm']['p50']:.3g} mm off (median)"
    rows = [Row("jerk, rms: openwbt filtered", outcome)]
    for name in ("precise", "precise, avoid", "precise, filtered"):
        for key in ("rms", "p99"):
            row = at_most(f"jerk, {key}: {name}", jerks[name][key] / seeds[key], 1.0, "x", judged=name == "precise")
            measured = f"{row.measured} openwbt filtered, {jerks[name][key] / own[key]:.3g} x the recordings'"
            rows.append(replace(row, measured=f"{measured}; {jerks[name]['mm']['p50']:.3g} mm off"))
    return rows
