"""The compiled heart of the solver: one descent function an arm, as generated C or in CasADi's virtual machine.

Both forms come from the same expressions. Generated C is used only after it has agreed with the virtual machine on
random problems at load time; where it cannot be built or does not agree, the virtual machine serves, about eight
times slower, and `note` says why.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import casadi as ca
import numpy as np

from ik_service.compiler import CompileError, library
from ik_service.descent import descent
from ik_service.objective import Preset
from ik_service.robot import ArmChain, Robot

AGREEMENT_PROBLEMS = 16
"""Random problems an arm on which generated C and virtual machine must agree."""

OUTSIDE = 0.3
"""How far beyond the limits such a problem may pull a joint [rad]."""

AGREEMENT = 1e-6
"""Largest difference of two solutions that agree [rad], of two reports, and of two torques [N m]; rounding leaves about
1e-9."""


@dataclass(frozen=True)
class Kernel:
    """Descent functions ready to be shared by any number of solvers.

    Attributes:
        preset: The cost they minimise.
        descents: One function an arm, left then right; `descent.descent` documents arguments and results.
        kind: "c" for generated C, "vm" for the virtual machine.
        note: One line on why the kernel is not what was asked for, or why the cache was not used; else empty.
    """

    preset: Preset
    descents: tuple[ca.Function, ca.Function]
    kind: Literal["c", "vm"]
    note: str = ""


def load_kernel(robot: Robot, preset: Preset, compiled: bool = True, folder: Path | None = None) -> Kernel:
    """Build the kernel of a robot and a preset.

    Args:
        robot: The robot.
        preset: The cost.
        compiled: Whether to use generated C where possible.
        folder: Cache folder of compiled kernels; None for the per-user one.

    Returns:
        The kernel; never fails for want of a compiler.
    """
    left, right = robot.arms
    machine = (descent(left, preset, "left_descent"), descent(right, preset, "right_descent"))
    if not compiled:
        return Kernel(preset, machine, "vm")
    try:
        with library(_source(machine), folder) as built:
            generated = (
                ca.external("left_descent", str(built.path)),
                ca.external("right_descent", str(built.path)),
            )
    except CompileError as error:
        return Kernel(preset, machine, "vm", str(error))
    except RuntimeError:  # CasADi, for a library that the dynamic loader refuses
        return Kernel(preset, machine, "vm", "the compiled kernel cannot be loaded")
    for arm, ours, theirs in zip(robot.arms, machine, generated, strict=True):
        if not agree(arm, ours, theirs):
            return Kernel(preset, machine, "vm", f"the compiled kernel of the {arm.side} arm computes something else")
    return Kernel(preset, generated, "c", built.note)


def agree(arm: ArmChain, first: ca.Function, second: ca.Function) -> bool:
    """Compare two descents of an arm on random problems.

    Targets are wrist poses of postures up to `OUTSIDE` beyond the limits, which draws joints onto the limits; starts
    are near those postures.

    Args:
        arm: The arm.
        first: A descent.
        second: Another.

    Returns:
        Whether both give the same answers, and the second keeps the limits to the last bit.
    """
    rng = np.random.default_rng(0)
    n = len(arm.joint_names)
    for _ in range(AGREEMENT_PROBLEMS):
        q = rng.uniform(arm.lower - OUTSIDE, arm.upper + OUTSIDE)
        target = arm.wrist(q)
        start = q + rng.normal(0.0, 0.05, n)
        q_first, report_first, tau_first = (np.array(out).ravel() for out in first(start, target, start, 0.0))
        q_second, report_second, tau_second = (np.array(out).ravel() for out in second(start, target, start, 0.0))
        inside = (arm.lower <= q_second).all() and (q_second <= arm.upper).all()
        pairs = ((q_first, q_second), (report_first[:4], report_second[:4]), (tau_first, tau_second))
        # Written so that NaN, which is close to nothing, fails.
        if not (inside and all(np.abs(a - b).max() <= AGREEMENT for a, b in pairs)):
            return False
    return True


def _source(functions: tuple[ca.Function, ca.Function]) -> str:
    generator = ca.CodeGenerator("kernel")
    for function in functions:
        generator.add(function)
    return generator.dump()
