"""Rate control where it is hard: sweeps into singular postures, limits, boxes and the body, and back; and squares.

    OMP_NUM_THREADS=1 python benchmarks/velocity.py [--random N] [--json FILE] [--chart FILE]

Every sweep starts at rest, asks the hand for 0.2 m/s one way, and then for the way back, with its orientation held. The
exit code is 1 when a joint is too fast or leaves its limits, an arm chatters, a hand goes a wrong way, or cannot get
away again; and when a hand that is led round a square of 30 cm strays or turns.

Of random postures some are singular from the start. There the way back may lead into what the hand has just got out of,
and where the arm is stretched or folded a hand that may not turn may have nowhere to go along one line. It must get
away all the same, in another direction or with its orientation free: 26 directions are tried. The time of a call is
reported, not judged. Takes some seconds.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.peers.environments import Unavailable, prepare
from benchmarks.sweeps.courses import ANYWHERE, HOME, courses
from benchmarks.sweeps.drive import Driven, drive, ways_out
from benchmarks.sweeps.square import Round, drive_round, squares
from ik_proto.limits import DEFAULT_ACCELERATION, DEFAULT_SPEED
from ik_proto.robots import load_description
from ik_service.dampers import RATE
from ik_service.resolved_rate import SINGULAR
from ik_service.robot import Robot
from ik_service.velocity import RateController
from ik_service.velocity_kernel import load_velocity_kernel

PACKAGES = ("ik-service", "casadi", "pin", "numpy")
SINGULAR_START = "singular start"
SHOWN_SPEED = 0.15
"""Of the squares that are drawn [m/s]."""

CHART_SCRIPT = Path(__file__).resolve().parent / "sweeps" / "chart.py"
MOST_TURNS = 3.0
"""Changes of direction of a joint a second that are no chatter."""

MOST_DEVIATION = 5.0
"""Largest angle between asked and achieved velocity [degrees]."""

MOST_ACCELERATION = DEFAULT_ACCELERATION + RATE * DEFAULT_SPEED
"""Largest acceleration: the one asked for, and what a near bound may brake beyond it [rad/s^2]."""


def faults(driven: Driven, margin: float, starts_clear: bool) -> list[str]:
    """What is wrong with a sweep."""
    checks = {
        f"a joint at {driven.speed:.3f} rad/s": driven.speed > DEFAULT_SPEED + 1e-9,
        f"acceleration {driven.acceleration:.1f} rad/s^2": driven.acceleration > MOST_ACCELERATION,
        f"{driven.turns:.1f} turns a second": driven.turns > MOST_TURNS,
        f"direction off by {driven.deviation:.1f} degrees": driven.deviation > MOST_DEVIATION,
        "the hand cannot get away": not driven.left and driven.manipulability >= SINGULAR["held"],
        "a joint beyond its limit": driven.room < 0.0,
        f"clearance {1e3 * driven.clearance:.2f} mm": starts_clear and driven.clearance < margin - 2e-4,
    }
    return [what for what, wrong in checks.items() if wrong]


MOST_PATH_ERROR, MOST_DRIFT = 3e-3, 1.0
"""How far a hand may stray from a square [m], and how far turn on the way [degrees]."""


def square_faults(found: Round) -> list[str]:
    """What is wrong with a way round a square."""
    checks = {
        f"{1e3 * found.path_error:.2f} mm from the path": found.path_error > MOST_PATH_ERROR,
        f"{1e3 * found.corner_error:.2f} mm from a corner": found.corner_error > MOST_PATH_ERROR,
        f"turned by {found.drift:.2f} degrees": found.drift > MOST_DRIFT,
        f"limited by {', '.join(found.limited)}": bool(found.limited),
    }
    return [what for what, wrong in checks.items() if wrong]


def time_of_a_call(control: RateController, calls: int = 2000) -> dict[str, float]:
    """Median time of a call of the kernel alone, and of the controller [us]."""
    twist, times = np.array([0.05, 0.02, 0.03, 0.0, 0.0, 0.0]), []
    for _ in range(calls):
        begin = time.perf_counter()
        control.solve(twist, twist, HOME, np.zeros(14))
        middle = time.perf_counter()
        control._call()
        times.append((time.perf_counter() - middle, middle - begin))
    kernel, whole = 1e6 * np.median(times, axis=0)
    return {"kernel_us": float(kernel), "controller_us": float(whole)}


def _draw(numbers: Path, chart: Path) -> str:
    try:
        python = prepare("chart")
    except Unavailable as error:
        return f"no chart: Matplotlib is {error}"
    result = subprocess.run([python, CHART_SCRIPT, numbers, chart], capture_output=True, text=True)
    return f"no chart: {result.stderr.strip().splitlines()[-1]}" if result.returncode else ""


def _sweeps(
    robot: Robot, control: RateController, random: int, traces: dict[str, Any], console: Console
) -> tuple[list[dict[str, Any]], list[str]]:
    """Drive all courses; rows of the table, and what is wrong."""
    found: dict[str, list[Driven]] = {}
    wrong, ways = [], {True: [], False: []}
    for course in courses(robot, random):
        driven = drive(robot, control, course)
        kind = course.kind
        if kind == ANYWHERE and driven.manipulability < SINGULAR["held"]:
            kind = SINGULAR_START
        found.setdefault(kind, []).append(driven)
        if len(found[kind]) == 1:
            traces[f"{kind}: {course.name}"] = driven.trace
        checked = course.options.get("collision") != "off"
        faulty = faults(driven, robot.collision.margin, checked)
        if kind == SINGULAR_START and (driven.stuck or not driven.left):
            for held, counts in ways.items():
                counts.append(ways_out(robot, control, driven.end, course.arm, held))
            if not any(counts[-1] for counts in ways.values()):
                faulty.append("the hand cannot get away in any direction")
        arm = ("left", "right")[course.arm]
        wrong += [f"{kind}, {arm}, {course.name}: {fault}" for fault in faulty]
    table = Table(title="sweeps of both arms, worst of each kind", title_justify="left")
    headings = ("kind", "sweeps", "rad/s", "rad/s^2", "turns/s", "deviation [deg]", "got back", "stuck", "room [mrad]")
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "kind" else "right")
    rows = []
    for kind, sweeps in found.items():
        worst = {
            key: max(getattr(one, key) for one in sweeps) for key in ("speed", "acceleration", "turns", "deviation")
        }
        stuck, room = sum(one.stuck for one in sweeps), min(one.room for one in sweeps)
        left = sum(one.left and not one.stuck for one in sweeps)
        rows.append({"kind": kind, "sweeps": len(sweeps), **worst, "left": left, "stuck": stuck, "room": room})
        numbers = (f"{worst['speed']:.2f}", f"{worst['acceleration']:.1f}", f"{worst['turns']:.1f}")
        table.add_row(
            kind, str(len(sweeps)), *numbers, f"{worst['deviation']:.1f}", str(left), str(stuck), f"{1e3 * room:.2f}"
        )
    console.print(table)
    if counts := ways[True]:
        console.print(
            f"{len(counts)} of the singular starts do not let the hand back; of 26 directions it gets away in "
            f"{min(counts)} to {max(counts)} (median {np.median(counts):.0f}) with its orientation held, in "
            f"{min(ways[False])} to {max(ways[False])} (median {np.median(ways[False]):.0f}) with it free"
        )
        rows[-1] |= {"ways_held": counts, "ways_free": ways[False]}
    return rows, wrong


def _squares(
    robot: Robot, control: RateController, paths: dict[str, Any], console: Console
) -> tuple[list[dict[str, Any]], list[str]]:
    """Lead the hands round all squares; rows of the table, and what is wrong."""
    table = Table(title="squares of 30 cm by velocity alone, orientation held", title_justify="left")
    headings = ("square", "arm", "m/s", "path [mm]", "corner [mm]", "drift [deg]", "rad/s", "room [rad]")
    for heading in headings:
        table.add_column(heading, justify="left" if heading in ("square", "arm") else "right")
    rows, wrong = [], []
    for square in squares():
        found, arm = drive_round(robot, control, square), ("left", "right")[square.arm]
        row = {key: getattr(found, key) for key in ("path_error", "corner_error", "drift", "speed", "room")}
        rows.append({"square": square.name, "arm": arm, "asked_speed": square.speed, **row})
        if square.arm == 0 and square.speed == SHOWN_SPEED:
            paths[square.name] = found.path.tolist()
        wrong += [f"square {square.name}, {arm}, {square.speed:g} m/s: {fault}" for fault in square_faults(found)]
        numbers = (f"{1e3 * found.path_error:.3f}", f"{1e3 * found.corner_error:.3f}", f"{found.drift:.3f}")
        table.add_row(square.name, arm, f"{square.speed:g}", *numbers, f"{found.speed:.2f}", f"{found.room:.2f}")
    console.print(table)
    return rows, wrong


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive all courses."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--random", type=int, default=200, metavar="N", help="random sweeps (200)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers to FILE")
    parser.add_argument("--chart", type=Path, metavar="FILE", help="draw a sweep of each kind to FILE, PNG or SVG")
    options = parser.parse_args(arguments)
    console = Console(width=max(Console().width, 130))
    robot = Robot.load(load_description("g1"))
    kernel = load_velocity_kernel(robot)
    control = RateController(robot, kernel)
    traces: dict[str, Any] = {}
    rows, wrong = _sweeps(robot, control, options.random, traces, console)
    paths: dict[str, Any] = {}
    ways, astray = _squares(robot, control, paths, console)
    wrong += astray
    timing = time_of_a_call(control)
    console.print(
        f"kernel {kernel.kind}: {timing['kernel_us']:.1f} us a call, {timing['controller_us']:.1f} with Python"
    )
    report = {
        "environment": environment(PACKAGES),
        "timing": timing,
        "rows": rows,
        "squares": ways,
        "faults": wrong,
        "traces": traces,
        "paths": paths,
    }
    text = json.dumps(report, indent=2) + "\n"
    if options.json:
        options.json.write_text(text, encoding="utf-8")
    if options.chart:
        with tempfile.TemporaryDirectory() as scratch:
            saved = Path(scratch) / "numbers.json"
            saved.write_text(text, encoding="utf-8")
            if complaint := _draw(saved, options.chart):
                console.print(complaint)
    for fault in wrong:
        console.print(f"missed: {fault}", style="red")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
