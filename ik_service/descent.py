"""A whole descent of one arm in one CasADi function: Newton iterations until the projected gradient vanishes.

The iterations are unrolled, in blocks. Once the descent has converged the rest of its block and all further blocks
are skipped, so a short descent costs what it needs and no more.
"""

from typing import Any

import casadi as ca

from ik_service.kinematics import gravity_torque, quaternion_of
from ik_service.newton import PROBLEM, STATE, clip, evaluation, iteration, symbols_like, when
from ik_service.objective import Preset
from ik_service.robot import ArmChain

TOLERANCE = 1e-6
"""Projected gradient, max norm, of a converged point [1/rad]. Its cost is within about 1e-11 of the local minimum,
because the curvature is at least 2 (regularization + smoothness)."""

ITERATIONS = 24
"""Iterations in one call. Tracking takes 3, a descent from a random start about 10 and rarely more than 20."""

BLOCK = 4
"""Iterations that are skipped together once the descent has converged."""

REPORT = ("cost", "projected_gradient", "position_error", "rotation_error", "iterations", "damping")
"""What a descent says of its end: cost, max norm of the projected gradient [1/rad], errors [m] and [rad], iterations
done, and the damping to go on with."""


def descent(chain: ArmChain, preset: Preset, name: str) -> ca.Function:
    """Build the descent of one arm.

    Args:
        chain: The arm, of n joints.
        preset: Weights of the cost.
        name: Name of the function.

    Returns:
        Function (q_start, T_target, q_last, damping) -> (q, report, tau). q_start is clipped to the limits; T_target is
        a 4x4 pose in the base frame; damping is 0, or the last entry of the report where a descent is to be continued;
        tau holds the arm at q against gravity [N m].
    """
    n = len(chain.joint_names)
    q_start, T_target = ca.MX.sym("q_start", n), ca.MX.sym("T_target", 4, 4)
    q_last, damping = ca.MX.sym("q_last", n), ca.MX.sym("damping")
    problem = [q_last, T_target[:3, 3], _target_quaternion(name)(T_target[:3, :3])]
    evaluate = evaluation(chain, preset, name)
    block = when(_repeated(when(iteration(chain, preset, evaluate, name)), BLOCK))
    state: list[Any] = [*evaluate(clip(q_start, chain), *problem), damping, ca.MX(0)]
    for _ in range(ITERATIONS // BLOCK):
        state = list(block(_running(state), *state, *problem))
    q, value, _, _, measures, damping_left, iterations = state
    report = ca.vertcat(value, measures, iterations, damping_left)
    tau = _gravity_torque(chain, name)(q)
    return ca.Function(name, [q_start, T_target, q_last, damping], [q, report, tau])


def _running(state: list[Any]) -> ca.MX:
    return state[STATE.index("measures")][0] > TOLERANCE


def _repeated(step: ca.Function, times: int) -> ca.Function:
    """Chain a guarded iteration: (state, problem) -> state."""
    inputs = symbols_like(step, range(1, 1 + len(STATE) + len(PROBLEM)))
    state, problem = inputs[: len(STATE)], inputs[len(STATE) :]
    for _ in range(times):
        state = list(step(_running(state), *state, *problem))
    return ca.Function(f"{step.name()}_x{times}", inputs, state)


def _gravity_torque(chain: ArmChain, name: str) -> ca.Function:
    q = ca.SX.sym("q", len(chain.joint_names))
    return ca.Function(f"{name}_gravity_torque", [q], [gravity_torque(chain, q)], {"cse": True})


def _target_quaternion(name: str) -> ca.Function:
    R = ca.SX.sym("R", 3, 3)
    return ca.Function(f"{name}_target_quaternion", [R], [quaternion_of(R)])
