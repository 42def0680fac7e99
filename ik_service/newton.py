"""One iteration of a projected Newton method with box constraints, as a CasADi function.

An iteration, from an accepted point q with cost f, gradient and Hessian (D. P. Bertsekas, "Projected Newton Methods for
Optimization Problems with Simple Constraints", SIAM J. Control and Optimization 20, 1982):

1. Joints at a limit with the gradient pushing outwards are held; the others are free.
2. On the free joints the Newton system is solved with Levenberg damping: with the exact Hessian where it is safely
   positive definite there, else with its convex part. The exact one settles targets far out of reach in two or three
   iterations, where Gauss-Newton crawls; the convex one finds good basins far from the optimum, where an exact Hessian
   made definite by force does not.
3. The step is clipped to the limits. The trial is accepted when the cost does not rise, and the damping shrinks to
   zero. Otherwise q stays and the damping grows.
"""

from typing import Any

import casadi as ca

from ik_service.ldl import factorize
from ik_service.objective import Preset, arm_convex_hessian, arm_cost
from ik_service.robot import ArmChain

MIN_PIVOT = 1e-2
"""Smallest pivot of a Hessian that counts as safely positive definite [1/rad^2]."""

FIRST_DAMPING = 1.0
"""Damping after a first rejected step [1/rad^2]; the G1's Hessian has eigenvalues from 0.2 to about 30."""

DAMPING_GROWTH = 10.0
"""Factor of the damping after a rejected step; its inverse after an accepted one."""

NEGLIGIBLE_DAMPING = 1e-6
"""Damping below this is dropped, which restores quadratic convergence [1/rad^2]."""

ROUNDING = 1e-14
"""Relative rise of the cost that counts as none: near the optimum of a far target the true decrease drowns in
rounding."""

STATE = ("q", "value", "gradient", "hessian", "measures", "damping", "iterations")
"""What an iteration maps to its like. `hessian` is the upper triangle, `measures` are projected gradient (max norm)
[1/rad], position error [m] and rotation error [rad]."""

PROBLEM = ("q_last", "p_target", "quaternion_target")
"""What an iteration takes besides: shapes (n,), (3,) and (4,)."""


def evaluation(chain: ArmChain, preset: Preset, name: str) -> ca.Function:
    """Build the function (q, problem) -> (q, value, gradient, hessian, measures).

    Args:
        chain: The arm.
        preset: Weights of the cost.
        name: Prefix of the function's name.

    Returns:
        The function; its results are the first five entries of the state.
    """
    n = len(chain.joint_names)
    q, q_last = ca.SX.sym("q", n), ca.SX.sym("q_last", n)
    p_target, quaternion_target = ca.SX.sym("p_target", 3), ca.SX.sym("quaternion_target", 4)
    cost = arm_cost(chain, preset, q, q_last, p_target, quaternion_target)
    gradient = ca.vertcat(*cost.gradient)
    projected = q - clip(q - gradient, chain)
    measures = ca.vertcat(ca.norm_inf(projected), cost.position_error, cost.rotation_error)
    return ca.Function(
        f"{name}_evaluation",
        [q, q_last, p_target, quaternion_target],
        [q, cost.value, gradient, _pack(cost.hessian), measures],
        {"cse": True},
    )


def iteration(chain: ArmChain, preset: Preset, evaluate: ca.Function, name: str) -> ca.Function:
    """Build the function (state, problem) -> state: one trial, accepted or not.

    Args:
        chain: The arm.
        preset: Weights of the cost.
        evaluate: The arm's `evaluation`.
        name: Prefix of the function's name.

    Returns:
        The function.
    """
    accept, newton_step = _acceptance(evaluate, name), _newton_step(chain, name)
    or_gauss_newton_step = when(_gauss_newton_step(chain, preset, name))
    state = symbols_like(accept, range(len(STATE)))
    problem = symbols_like(evaluate, range(1, 1 + len(PROBLEM)))
    q, _, gradient, hessian, _, damping, _ = state
    step, smallest_pivot = newton_step(q, gradient, hessian, damping)
    step = or_gauss_newton_step(smallest_pivot <= MIN_PIVOT, step, q, gradient, damping, problem[-1])
    trial = evaluate(clip(q + step, chain), *problem)
    return ca.Function(f"{name}_iteration", state + problem, list(accept(*state, *trial)))


def clip(q: Any, chain: ArmChain) -> Any:
    """Move an SX or MX q into the limits of the arm; a joint beyond one lands on it to the last bit."""
    return ca.fmin(ca.fmax(q, chain.lower), chain.upper)


def when(function: ca.Function) -> ca.Function:
    """Guard a function whose first arguments are what it returns.

    Args:
        function: A function (x, y) -> x.

    Returns:
        Function (condition, x, y) -> x, which returns x untouched where the condition does not hold. Only the branch
        taken is evaluated, in generated C and in the virtual machine alike.
    """
    inputs = symbols_like(function, range(function.n_in()))
    keep = ca.Function(f"{function.name()}_not", inputs, inputs[: function.n_out()])
    return ca.Function.if_else(f"{function.name()}_when", function, keep)


def symbols_like(function: ca.Function, inputs: range) -> list[Any]:
    """Make MX symbols of the shapes of some inputs of a function."""
    return [ca.MX.sym(function.name_in(i), function.sparsity_in(i)) for i in inputs]


def _acceptance(evaluate: ca.Function, name: str) -> ca.Function:
    """(state, evaluated trial) -> state."""
    point, trial = (
        [ca.SX.sym(f"{prefix}{i}", evaluate.sparsity_out(i)) for i in range(evaluate.n_out())]
        for prefix in ("point", "trial")
    )
    damping, iterations = ca.SX.sym("damping"), ca.SX.sym("iterations")
    accepted = trial[1] <= point[1] + ROUNDING * ca.fabs(point[1])
    chosen = [ca.if_else(accepted, new, old) for new, old in zip(trial, point, strict=True)]
    less = damping / DAMPING_GROWTH
    next_damping = ca.if_else(
        accepted,
        ca.if_else(less > NEGLIGIBLE_DAMPING, less, 0.0),
        ca.fmax(damping * DAMPING_GROWTH, FIRST_DAMPING),
    )
    inputs = [*point, damping, iterations, *trial]
    return ca.Function(f"{name}_acceptance", inputs, [*chosen, next_damping, iterations + 1])


def _newton_step(chain: ArmChain, name: str) -> ca.Function:
    """(q, gradient, hessian, damping) -> (step, smallest pivot); the step is a descent where that pivot is positive."""
    n = len(chain.joint_names)
    q, gradient, damping = ca.SX.sym("q", n), ca.SX.sym("gradient", n), ca.SX.sym("damping")
    hessian = ca.SX.sym("hessian", n * (n + 1) // 2)
    step, smallest_pivot = _solve_on_free_joints(chain, _unpack(hessian, n), q, gradient, damping)
    inputs, outputs = [q, gradient, hessian, damping], [step, smallest_pivot]
    return ca.Function(f"{name}_newton_step", inputs, outputs, {"cse": True})


def _gauss_newton_step(chain: ArmChain, preset: Preset, name: str) -> ca.Function:
    """(replaced step, q, gradient, damping, target quaternion) -> step from the convex part of the Hessian."""
    n = len(chain.joint_names)
    q, gradient, damping = ca.SX.sym("q", n), ca.SX.sym("gradient", n), ca.SX.sym("damping")
    quaternion_target = ca.SX.sym("quaternion_target", 4)
    convex = arm_convex_hessian(chain, preset, q, quaternion_target)
    step, _ = _solve_on_free_joints(chain, convex, q, gradient, damping)
    inputs = [ca.SX.sym("replaced", n), q, gradient, damping, quaternion_target]
    return ca.Function(f"{name}_gauss_newton_step", inputs, [step], {"cse": True})


def _solve_on_free_joints(
    chain: ArmChain, H: list[list[ca.SX]], q: ca.SX, gradient: ca.SX, damping: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Solve (H + damping I) step = -gradient on the free joints, and return the smallest pivot too."""
    n = len(chain.joint_names)
    free = []
    for i in range(n):
        held_low = ca.logic_and(q[i] <= chain.lower[i], gradient[i] > 0.0)
        held_high = ca.logic_and(q[i] >= chain.upper[i], gradient[i] < 0.0)
        free.append(1 - ca.logic_or(held_low, held_high))
    # Rows and columns of held joints become those of the identity.
    restricted = [[free[i] * free[j] * H[i][j] for j in range(n)] for i in range(n)]
    for i in range(n):
        restricted[i][i] = free[i] * (H[i][i] + damping) + (1 - free[i])
    factors = factorize(restricted)
    step = factors.solve([-free[i] * gradient[i] for i in range(n)])
    return ca.vertcat(*step), factors.smallest_pivot


def _pack(H: list[list[ca.SX]]) -> ca.SX:
    return ca.vertcat(*[H[i][j] for i in range(len(H)) for j in range(i, len(H))])


def _unpack(packed: ca.SX, n: int) -> list[list[ca.SX]]:
    entries = iter(ca.vertsplit(packed))
    H = [[ca.SX(0)] * n for _ in range(n)]
    for i in range(n):
        for j in range(i, n):
            H[i][j] = H[j][i] = next(entries)
    return H
