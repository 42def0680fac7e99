"""The compiled form of the rate control, made, checked and cached as the solver's kernel is: see `generated`."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import casadi as ca
import numpy as np

from ik_service.generated import AGREEMENT, AGREEMENT_PROBLEMS, building
from ik_service.layout import AVOID, REPORT_ONLY
from ik_service.robot import Robot
from ik_service.velocity_law import FREE, REPORT, VelocityLayout, velocity_law

_COMPARED = [i for i, key in enumerate(REPORT) if key.startswith(("manipulability", "damping", "clearance"))]
"""Scales and places are left out: of an arm that hardly moves rounding decides them."""


@dataclass(frozen=True)
class VelocityKernel:
    """The rate control, ready to be shared by any number of controllers.

    Attributes:
        law: See `velocity_law.velocity_law`.
        kind: "c" for generated C, "vm" for CasADi's virtual machine.
        note: One line on why it is not generated C, or why the cache was not used; else empty.
    """

    law: ca.Function
    kind: Literal["c", "vm"]
    note: str = ""


@contextmanager
def building_velocity_kernel(
    robot: Robot, compiled: bool = True, folder: Path | None = None
) -> Generator[Callable[[], VelocityKernel]]:
    """Begin to build the rate control of a robot; takes and yields what `kernel.building_kernel` does."""
    machine = velocity_law(robot)

    def agrees(generated: tuple[ca.Function, ...]) -> bool:
        return agree(robot, machine, *generated)

    with building("rate control", [machine], agrees, compiled, folder) as finish:

        def kernel() -> VelocityKernel:
            form = finish()
            return VelocityKernel(*form.functions, form.kind, form.note)

        yield kernel


def load_velocity_kernel(robot: Robot, compiled: bool = True, folder: Path | None = None) -> VelocityKernel:
    """Build the rate control of a robot; as `building_velocity_kernel`, but waits for it."""
    with building_velocity_kernel(robot, compiled, folder) as kernel:
        return kernel()


def agree(robot: Robot, first: ca.Function, second: ca.Function) -> bool:
    """Compare two forms of the rate control on random problems.

    Args:
        robot: The robot.
        first: One form.
        second: The other.

    Returns:
        Whether both give the same answers.
    """
    rng = np.random.default_rng(0)
    layout = VelocityLayout.of(robot)
    for k in range(AGREEMENT_PROBLEMS):
        vectors = []
        for parts, values in (
            (layout.request, _random_request(robot, rng)),
            (layout.options, _random_options(robot, rng, fixed=k % 4 == 3, avoid=k % 2 == 0)),
        ):
            vector = np.zeros(max(part.stop for part in parts.values()))
            for key, value in values.items():
                vector[parts[key]] = value
            vectors.append(vector)
        answer, report = (np.array(out).ravel() for out in first(*vectors))
        again, report_again = (np.array(out).ravel() for out in second(*vectors))
        same = np.isclose(report[_COMPARED], report_again[_COMPARED], rtol=AGREEMENT, atol=AGREEMENT).all()
        # Written so that NaN, which is close to nothing, fails.
        if not (same and np.abs(answer - again).max() <= AGREEMENT):
            return False
    return True


def _random_request(robot: Robot, rng: np.random.Generator) -> dict[str, np.ndarray]:
    q, dq = rng.uniform(robot.lower, robot.upper), rng.normal(0.0, 0.2, robot.nq)
    return {"q": q, "dq": dq, "twists": rng.normal(0.0, 0.2, 12)}


def _random_options(robot: Robot, rng: np.random.Generator, fixed: bool, avoid: bool) -> dict[str, object]:
    return {
        "waist": rng.uniform(-0.2, 0.2, len(robot.waist.joint_names)),
        "fixed": fixed,
        "damping": 0.05,
        "max_speed": 1.5,
        "posture_gain": 1.0,
        "held": rng.integers(0, 2, 2),
        "bounds": FREE * np.repeat([-1.0, 1.0, -1.0, 1.0], 3),
        "max_acceleration": 12.0,
        "period": 0.02,
        "collision": AVOID if avoid else REPORT_ONLY,
        "posture": 0.5 * (robot.lower + robot.upper),
    }
