"""The compiled heart of the solver: its CasADi functions, as generated C or in CasADi's virtual machine.

See `generated`. The virtual machine is about eight times slower.
"""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import casadi as ca
import numpy as np

from ik_service.arm import Arm
from ik_service.avoidance import avoidance
from ik_service.dual_arm import dual_arm
from ik_service.generated import AGREEMENT, AGREEMENT_PROBLEMS, building
from ik_service.layout import OFF, REPORT, REPORT_ONLY, Inputs, Layout
from ik_service.preset import Preset
from ik_service.problem import Problem
from ik_service.reach import attempt
from ik_service.robot import Robot
from ik_service.seeds import Seeds

ROWS = 32
"""Problems of a batch that one call solves."""
OUTSIDE = 0.3
"""How far beyond the limits such a problem may pull a joint [rad]."""

_COMPARED = [
    REPORT.index(key) for key in REPORT if key not in ("settled_left", "settled_right", "iterations", "nearest")
]


@dataclass(frozen=True)
class Kernel:
    """Functions ready to be shared by any number of solvers.

    Attributes:
        solve: See `dual_arm.dual_arm`.
        attempt: See `reach.attempt`.
        solve_rows: `solve` for `ROWS` problems at once, vectors side by side in columns.
        seeds: Starts of the left and of the right arm.
        kind: "c" for generated C, "vm" for the virtual machine.
        note: One line on why the kernel is not what was asked for, or why the cache was not used; else empty.
    """

    solve: ca.Function
    attempt: ca.Function
    solve_rows: ca.Function
    seeds: tuple[Seeds, Seeds]
    kind: Literal["c", "vm"]
    note: str = ""


@contextmanager
def building_kernel(robot: Robot, compiled: bool = True, folder: Path | None = None) -> Generator[Callable[[], Kernel]]:
    """Begin to build the kernel of a robot.

    Args:
        robot: The robot.
        compiled: Whether to use generated C where possible.
        folder: Cache folder of compiled kernels; None for the per-user one.

    Yields:
        What waits for the kernel and returns it; it never fails for want of a compiler.
    """
    machine, (left, right) = functions(robot), robot.arms
    seeds = (Seeds(left), Seeds(right))

    def agrees(generated: tuple[ca.Function, ...]) -> bool:
        return agree(robot, machine, Functions(*generated))

    with building("kernel", machine, agrees, compiled, folder) as finish:

        def kernel() -> Kernel:
            form = finish()
            return Kernel(*form.functions, seeds, form.kind, form.note)

        yield kernel


def load_kernel(robot: Robot, compiled: bool = True, folder: Path | None = None) -> Kernel:
    """Build the kernel of a robot; as `building_kernel`, but waits for it."""
    with building_kernel(robot, compiled, folder) as kernel:
        return kernel()


class Functions(NamedTuple):
    """The functions of a kernel, by their names in generated C."""

    solve: ca.Function
    attempt: ca.Function
    solve_rows: ca.Function


def functions(robot: Robot) -> Functions:
    """Build the functions of a kernel in the virtual machine."""
    arms = [Arm.of(chain) for chain in robot.arms]
    inputs = Inputs.of(robot, arms)
    keep_clear = avoidance(robot, arms) if robot.collision.pairs else None
    solve = dual_arm(robot, arms, inputs, keep_clear)
    return Functions(solve, attempt(robot, arms, inputs, keep_clear), _rows(solve))


def _rows(solve: ca.Function) -> ca.Function:
    """`solve` mapped over columns."""
    inputs = [ca.MX.sym(name, solve.size1_in(name), ROWS) for name in solve.name_in()]
    outputs = solve.map(ROWS)(*inputs)
    return ca.Function("solve_rows", inputs, list(outputs))


def agree(robot: Robot, first: Functions, second: Functions) -> bool:
    """Compare two forms of a kernel on random problems.

    Targets are wrist poses of postures up to `OUTSIDE` beyond the limits, which draws joints onto the limits; starts
    are near those postures.

    Args:
        robot: The robot.
        first: One form.
        second: The other.

    Returns:
        Whether both give the same answers, and the second keeps the limits to the last bit.
    """
    rng = np.random.default_rng(0)
    layout, nq = Layout.of(robot), robot.nq
    for k in range(AGREEMENT_PROBLEMS):
        problem = Problem(layout, Preset("agreement", 50.0, 1.0, 0.02, 0.1))
        q = rng.uniform(robot.lower - OUTSIDE, robot.upper + OUTSIDE)
        start = q + rng.normal(0.0, 0.05, nq)
        problem.pose(start, *robot.fk(q))
        problem.collision = REPORT_ONLY if k % 2 else OFF
        vectors = (problem.request, problem.options)
        for mine, theirs, arguments in (
            (first.solve, second.solve, vectors),
            (first.attempt, second.attempt, (start, np.ones(2), *vectors)),
        ):
            answer, report = (np.array(out).ravel() for out in mine(*arguments))
            again, report_again = (np.array(out).ravel() for out in theirs(*arguments))
            q_again = again[:nq]
            inside = (robot.lower <= q_again).all() and (q_again <= robot.upper).all()
            same_report = np.isclose(report[_COMPARED], report_again[_COMPARED], rtol=0.0, atol=AGREEMENT).all()
            # Written so that NaN, which is close to nothing, fails.
            if not (inside and np.abs(answer - again).max() <= AGREEMENT and same_report):
                return False
    return True
