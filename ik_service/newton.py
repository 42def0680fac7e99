"""One iteration of a projected Newton method with box constraints, as a CasADi function.

An iteration, from an accepted point q with cost f, gradient and curvature (D. P. Bertsekas, "Projected Newton Methods
for Optimization Problems with Simple Constraints", SIAM J. Control and Optimization 20, 1982):

1. Joints at a limit with the gradient pushing outwards are held; the others are free.
2. On the free joints the Newton system is solved with Levenberg damping: with the exact Hessian where that is wanted
   and safely positive definite, else with its convex part. The exact one settles targets far out of reach in two or
   three iterations, where Gauss-Newton crawls; the convex one finds good basins far from the optimum, where an exact
   Hessian made definite by force does not, and is as good where hardly any error remains.
3. The step is clipped to the limits. The trial is accepted when the cost does not rise, and the damping shrinks to
   zero. Otherwise q stays and the damping grows.

The descent has settled when the projected gradient vanishes, or when an accepted, undamped Newton step was so short
that what it leaves, which is of the order of its square, does not matter.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ik_service.ldl import factorize

TOLERANCE = 1e-6
"""Projected gradient, max norm, of a settled point [1/rad]."""

SHORT_STEP = 1e-3
"""Newton step, max norm, after which a point counts as settled [rad]; the next one would be about its square."""

FIRST_DAMPING = 1.0
"""Damping after a first rejected step [1/rad^2]; the G1's Hessian has eigenvalues up to about 30."""

DAMPING_GROWTH = 10.0
"""Factor of the damping after a rejected step; its inverse after an accepted one."""

NEGLIGIBLE_DAMPING = 1e-6
"""Damping below this is dropped, which restores quadratic convergence [1/rad^2]."""

NO_ERROR = 1e-7
"""Error part of the cost below which Gauss-Newton is as good as Newton: 45 um or 0.02 degrees of weights 50 and 1."""

ROUNDING = 1e-14
"""Relative rise of the cost that counts as none: near the optimum of a far target the true decrease drowns in
rounding."""

FIRST = 4
"""Iterations that are nested one in the other; tracking takes 2 or 3."""

STATE = ("q", "value", "gradient", "curvature", "measures", "damping", "iterations", "settled")
"""What an iteration maps to its like. `curvature` is whatever the Hessian is made of; `measures` are projected
gradient (max norm) [1/rad], the part of the cost that errors make, whether the exact Hessian is wanted, whether the
point will do as it is, and whatever else; `settled` is 0 or 1."""


@dataclass(frozen=True)
class Objective:
    """What is minimised, as CasADi functions.

    Attributes:
        evaluate: (q, problem) -> (q, value, gradient, curvature, measures).
        exact_step: (q, gradient, curvature, damping, problem) -> (Newton step, safety): the step is one of descent
            where safety > 0.
        convex_step: The same with the convex part of the Hessian, always one of descent.
        lower: Lower limits [rad], shape (n,).
        upper: Upper limits [rad], shape (n,).
        longest_step: Longest step, max norm [rad].
        patient: Whether a descent goes on to the optimum; else any accepted step as short as `SHORT_STEP` ends it.
    """

    evaluate: ca.Function
    exact_step: ca.Function
    convex_step: ca.Function
    lower: np.ndarray
    upper: np.ndarray
    longest_step: float = np.inf
    patient: bool = True

    def clip(self, q: Any) -> Any:
        """Move an SX or MX q into the limits; a joint beyond one lands on it to the last bit."""
        return ca.fmin(ca.fmax(q, self.lower), self.upper)


def descent(objective: Objective, blocks: tuple[int, ...], name: str) -> ca.Function:
    """Build a whole descent: iterations until the point has settled, unrolled.

    The first few are nested, each with all that follows inside it, so that a short descent skips the rest once; the
    others come in blocks of blocks.

    Args:
        objective: What is minimised.
        blocks: How the iterations after the first are nested: the first number of them in a block, the second of those
            in a larger one, and so on.
        name: Name of the function.

    Returns:
        Function (q_start, problem) -> (q, value, measures, iterations, settled). q_start is clipped to the limits.
    """
    q_start, problem = (ca.MX.sym(key, objective.evaluate.sparsity_in(i)) for i, key in enumerate(("q_start", "p")))
    once = iteration(objective, name)
    rest = when(once)
    for times in blocks:
        rest = when(_repeated(rest, times))
    for k in range(FIRST):
        rest = when(_then(once, rest, f"{name}_{FIRST - k}"))
    evaluated = list(objective.evaluate(objective.clip(q_start), problem))
    state = [*evaluated, ca.MX(0), ca.MX(0), ca.logic_or(evaluated[4][0] <= TOLERANCE, evaluated[4][3])]
    q, value, _, _, measures, _, iterations, settled = rest(_running(state), *state, problem)
    return ca.Function(name, [q_start, problem], [q, value, measures, iterations, settled])


def iteration(objective: Objective, name: str) -> ca.Function:
    """Build the function (state, problem) -> state: one trial, accepted or not.

    Args:
        objective: What is minimised.
        name: Prefix of the function's name.

    Returns:
        The function.
    """
    evaluate = objective.evaluate
    state = [*symbols_like(evaluate), *(ca.MX.sym(key) for key in STATE[5:])]
    problem = ca.MX.sym("problem", evaluate.sparsity_in(1))
    q, _, gradient, curvature, measures, damping, _, _ = state
    arguments = (q, gradient, curvature, damping, problem)
    none = [ca.MX.zeros(q.numel()), ca.MX(-1.0)]
    step, safety = when(_replaced(objective.exact_step, name))(measures[2], *none, *arguments)
    step, _ = when(_replaced(objective.convex_step, name))(safety <= 0.0, step, safety, *arguments)
    if np.isfinite(objective.longest_step):
        step *= ca.fmin(1.0, objective.longest_step / (ca.norm_inf(step) + 1e-300))
    trial = evaluate(objective.clip(q + step), problem)
    return ca.Function(
        f"{name}_iteration", [*state, problem], list(_acceptance(objective, name)(*state, safety, *trial))
    )


def solve_on_free_joints(
    H: list[list[ca.SX]], q: ca.SX, gradient: ca.SX, damping: ca.SX, lower: np.ndarray, upper: np.ndarray
) -> tuple[ca.SX, ca.SX]:
    """Solve (H + damping I) step = -gradient on the joints that no limit holds.

    Args:
        H: Hessian, n x n scalars.
        q: Joint positions [rad], shape (n,).
        gradient: Of the cost, shape (n,).
        damping: Levenberg damping.
        lower: Lower limits [rad], shape (n,).
        upper: Upper limits [rad], shape (n,).

    Returns:
        The step, zero for held joints, and the smallest pivot of the factorization.
    """
    n, free = len(H), []
    for i in range(n):
        held_low = ca.logic_and(q[i] <= lower[i], gradient[i] > 0.0)
        held_high = ca.logic_and(q[i] >= upper[i], gradient[i] < 0.0)
        free.append(1 - ca.logic_or(held_low, held_high))
    # Rows and columns of held joints become those of the identity.
    restricted = [[free[i] * free[j] * H[i][j] for j in range(n)] for i in range(n)]
    for i in range(n):
        restricted[i][i] = free[i] * (H[i][i] + damping) + (1 - free[i])
    factors = factorize(restricted)
    step = factors.solve([-free[i] * gradient[i] for i in range(n)])
    return ca.vertcat(*step), factors.smallest_pivot


def when(function: ca.Function) -> ca.Function:
    """Guard a function whose first arguments are what it returns.

    Args:
        function: A function (x, y) -> x.

    Returns:
        Function (condition, x, y) -> x, which returns x untouched where the condition does not hold. Only the branch
        taken is evaluated, in generated C and in the virtual machine alike.
    """
    inputs = [ca.MX.sym(function.name_in(i), function.sparsity_in(i)) for i in range(function.n_in())]
    keep = ca.Function(f"{function.name()}_not", inputs, inputs[: function.n_out()])
    return ca.Function.if_else(f"{function.name()}_when", function, keep)


def symbols_like(function: ca.Function) -> list[Any]:
    """Make MX symbols of the shapes of a function's outputs."""
    return [ca.MX.sym(function.name_out(i), function.sparsity_out(i)) for i in range(function.n_out())]


def _running(state: list[Any]) -> ca.MX:
    return state[STATE.index("settled")] == 0


def _then(once: ca.Function, rest: ca.Function, name: str) -> ca.Function:
    """One iteration and, unless that settles it, the rest: (state, problem) -> state."""
    inputs = [ca.MX.sym(once.name_in(i), once.sparsity_in(i)) for i in range(once.n_in())]
    state = list(once(*inputs))
    return ca.Function(name, inputs, list(rest(_running(state), *state, inputs[-1])))


def _repeated(step: ca.Function, times: int) -> ca.Function:
    """Chain a guarded step: (state, problem) -> state."""
    inputs = [ca.MX.sym(step.name_in(i), step.sparsity_in(i)) for i in range(1, step.n_in())]
    state, problem = inputs[:-1], inputs[-1]
    for _ in range(times):
        state = list(step(_running(state), *state, problem))
    return ca.Function(f"{step.name()}_x{times}", inputs, state)


def _replaced(make_step: ca.Function, name: str) -> ca.Function:
    """(step and safety to be replaced, q, gradient, curvature, damping, problem) -> (step, safety)."""
    inputs = [ca.MX.sym(make_step.name_in(i), make_step.sparsity_in(i)) for i in range(make_step.n_in())]
    step, safety = make_step(*inputs)
    old = [ca.MX.sym("step", step.sparsity()), ca.MX.sym("safety")]
    return ca.Function(f"{name}_{make_step.name()}", [*old, *inputs], [step, safety])


def _acceptance(objective: Objective, name: str) -> ca.Function:
    """(state, safety of the Hessian, evaluated trial) -> state."""
    point, trial = symbols_like(objective.evaluate), symbols_like(objective.evaluate)
    damping, iterations, settled, safety = (ca.MX.sym(key) for key in (*STATE[5:], "safety"))
    ends = (point[0], point[1], point[4][0], trial[0], trial[1], trial[4][0], trial[4][1])
    accepted, next_damping, at_rest = _verdict(name, point[0].numel(), objective.patient)(*ends, damping, safety)
    go_back = when(ca.Function(f"{name}_go_back", [*trial, *point], point))
    chosen = go_back(accepted == 0, *trial, *point)
    now_settled = ca.logic_or(at_rest, chosen[4][3])
    inputs = [*point, damping, iterations, settled, safety, *trial]
    return ca.Function(f"{name}_acceptance", inputs, [*chosen, next_damping, iterations + 1, now_settled])


def _verdict(name: str, n: int, patient: bool) -> ca.Function:
    """(q, value, gradient norm of point and trial; error, damping, safety) -> (accepted, next damping, settled)."""
    point, trial = ([ca.SX.sym(key, size) for key, size in (("q", n), ("value", 1), ("norm", 1))] for _ in range(2))
    error, damping, safety = (ca.SX.sym(key) for key in ("error", "damping", "safety"))
    accepted = trial[1] <= point[1] + ROUNDING * ca.fabs(point[1])
    less = damping / DAMPING_GROWTH
    next_damping = ca.if_else(
        accepted,
        ca.if_else(less > NEGLIGIBLE_DAMPING, less, 0.0),
        ca.fmax(damping * DAMPING_GROWTH, FIRST_DAMPING),
    )
    quadratic = ca.logic_or(safety > 0.0, error <= NO_ERROR)
    last = ca.logic_and(accepted, ca.logic_and(damping == 0.0, quadratic)) if patient else accepted
    short = ca.logic_and(last, ca.norm_inf(trial[0] - point[0]) <= SHORT_STEP)
    still = ca.if_else(accepted, trial[2], point[2]) <= TOLERANCE
    inputs = [*point, *trial, error, damping, safety]
    return ca.Function(f"{name}_verdict", inputs, [accepted, next_damping, ca.logic_or(short, still)])
