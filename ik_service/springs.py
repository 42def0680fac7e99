"""Both arms among springs that keep capsules apart: the coupled cost of avoidance, as CasADi functions.

    f(q) = f_left(q) + f_right(q) + stiffness / 2 sum_k max(0, floor_k - d_k(q))^2

A spring gives way by the force of the task over its stiffness, so floors lie a little above what is to be kept.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from ik_service.arm import Arm, step_of
from ik_service.clearance import Segment, closest, pair_gradient
from ik_service.newton import Objective, when
from ik_service.objective import ArmProblem, Geometry, arm_hessian
from ik_service.proximity import Proximity
from ik_service.robot import Robot

STIFFNESS = 3e5
"""Of the springs [1/m^2]. A target half a metre behind an obstacle presses with a force of 50 per metre and gets 0.2 mm
of it."""

LONGEST_STEP = 0.15
"""Longest step of a joint in an iteration [rad]: less than 80 mm at the hand, thinner than any limb."""

GROUP = 8
"""Pairs that are passed over together when none of them is too near."""


def coupled_objective(robot: Robot, arms: Sequence[Arm], proximity: Proximity) -> Objective:
    """Make the coupled cost ready for a descent.

    Args:
        robot: The robot.
        arms: Its arms' functions.
        proximity: Its collision functions.

    Returns:
        The objective; its problem is that of the left arm, that of the right arm, the floors [m], shape (pairs,), and
        the ends of the base's capsules, one after the other.
    """
    springs = _springs(robot, proximity)
    nq, split = robot.nq, arms[0].n
    sizes = [arm.problem_size for arm in arms]
    pairs, ends_shape = proximity.pairs, proximity.shape.size_in(1)
    total = sum(sizes) + pairs + ends_shape[0] * ends_shape[1]
    q, problem = ca.MX.sym("q", nq), ca.MX.sym("problem", total)
    cuts = [0, sizes[0], sum(sizes), sum(sizes) + pairs, total]
    left_problem, right_problem, floors, base_ends = ca.vertsplit(problem, cuts)
    _, f_left, g_left, geometry_left, m_left = arms[0].objective.evaluate(q[:split], left_problem)
    _, f_right, g_right, geometry_right, m_right = arms[1].objective.evaluate(q[split:], right_problem)
    value, gradient, hessian = springs(q, floors, ca.reshape(base_ends, *ends_shape))
    gradient += ca.vertcat(g_left, g_right)
    projected = q - ca.fmin(ca.fmax(q - gradient, robot.lower), robot.upper)
    wanted = ca.logic_or(m_left[2], m_right[2])
    enough = ca.logic_and(value == 0.0, ca.logic_and(m_left[3], m_right[3]))
    measures = ca.vertcat(ca.norm_inf(projected), m_left[1] + m_right[1], wanted, enough)
    curvature = ca.vertcat(geometry_left, geometry_right, hessian)
    evaluate = ca.Function(
        "coupled_evaluation", [q, problem], [q, f_left + f_right + value, gradient, curvature, measures]
    )
    return Objective(
        evaluate=evaluate,
        exact_step=_coupled_step(robot, evaluate, exact=True),
        convex_step=_coupled_step(robot, evaluate, exact=False),
        lower=robot.lower,
        upper=robot.upper,
        longest_step=LONGEST_STEP,
        patient=False,
    )


def _coupled_step(robot: Robot, evaluate: ca.Function, exact: bool) -> ca.Function:
    nq = robot.nq
    sizes = {"q": nq, "gradient": nq, "curvature": evaluate.numel_out(3), "damping": 1}
    arguments = [ca.SX.sym(key, size) for key, size in (*sizes.items(), ("problem", evaluate.numel_in(1)))]
    curvature, problem = arguments[2], arguments[-1]
    H, packed = [[ca.SX(0)] * nq for _ in range(nq)], sum(Geometry.size(arm) for arm in robot.arms)
    for i in range(nq):
        for j in range(i, nq):
            H[i][j] = H[j][i] = curvature[packed]
            packed += 1
    first, geometry_at, problem_at, least = 0, 0, 0, ca.SX(np.inf)
    for arm in robot.arms:
        n, size, length = arm.n, Geometry.size(arm), ArmProblem.size(arm.n)
        weights = ArmProblem.split(problem[problem_at : problem_at + length], n).weights
        block = arm_hessian(arm, Geometry.split(curvature[geometry_at : geometry_at + size], arm), weights, exact)
        for i in range(n):
            for j in range(n):
                H[first + i][first + j] = H[first + i][first + j] + block[i][j]
        least = ca.fmin(least, weights[2] + weights[3])
        first, geometry_at, problem_at = first + n, geometry_at + size, problem_at + length
    name = f"coupled_{'exact' if exact else 'convex'}_step"
    return ca.Function(name, arguments, step_of(H, least, arguments, (robot.lower, robot.upper)), {"cse": True})


def _springs(robot: Robot, proximity: Proximity) -> ca.Function:
    """(q, floors, base ends) -> (value, gradient, upper triangle of the convex Hessian) of the springs."""
    nq, pairs = robot.nq, proximity.pairs
    q, floors = ca.MX.sym("q", nq), ca.MX.sym("floors", pairs)
    base_ends = ca.MX.sym("base_ends", proximity.shape.sparsity_in(1))
    ends, lines = proximity.shape(q, base_ends)
    short = floors - proximity.clearances(ends)
    spring = when(_spring(nq))
    sums = [ca.MX(0), ca.MX.zeros(nq), ca.MX.zeros(nq * (nq + 1) // 2)]
    for first in range(0, pairs, GROUP):
        group = range(first, min(first + GROUP, pairs))
        block = when(_spring_group(robot, proximity, spring, group))
        mine = short[group.start : group.stop]
        sums = list(block(ca.mmax(mine) > 0.0, *sums, mine, ends, lines))
    return ca.Function("springs", [q, floors, base_ends], sums)


def _spring_group(robot: Robot, proximity: Proximity, spring: ca.Function, group: range) -> ca.Function:
    """(sums, shortfalls of the group, ends, lines) -> sums."""
    nq = robot.nq
    inputs = [ca.MX.sym("value"), ca.MX.sym("gradient", nq), ca.MX.sym("H", nq * (nq + 1) // 2)]
    short = ca.MX.sym("short", len(group))
    ends, lines = (ca.MX.sym(key, proximity.shape.sparsity_out(i)) for i, key in enumerate(("ends", "lines")))
    sums = inputs
    for place, pair in enumerate(group):
        a, b = proximity.model.pairs[pair]
        segments = (ends[:, 2 * a : 2 * a + 2], ends[:, 2 * b : 2 * b + 2])
        moves = proximity.moves(pair, robot.arms)
        sums = list(spring(short[place] > 0.0, *sums, short[place], *segments, lines, moves))
    return ca.Function(f"springs_{group[0]}", [*inputs, short, ends, lines], sums)


def _spring(nq: int) -> ca.Function:
    """(sums, shortfall, ends of a, ends of b, lines, moves) -> sums with one more spring."""
    value, gradient, hessian = ca.SX.sym("value"), ca.SX.sym("gradient", nq), ca.SX.sym("H", nq * (nq + 1) // 2)
    short, moves, lines = ca.SX.sym("short"), ca.SX.sym("moves", nq), ca.SX.sym("lines", 6, nq)
    ends = [ca.SX.sym(key, 3, 2) for key in ("a", "b")]
    near = closest(*(Segment(e[:, 0], e[:, 1] - e[:, 0], ca.sumsqr(e[:, 1] - e[:, 0])) for e in ends))
    row = pair_gradient(near, lines, moves)
    force = STIFFNESS * short
    packed = [STIFFNESS * row[i] * row[j] for i in range(nq) for j in range(i, nq)]
    outputs = [value + 0.5 * force * short, gradient - force * row, hessian + ca.vertcat(*packed)]
    return ca.Function("spring", [value, gradient, hessian, short, *ends, lines, moves], outputs, {"cse": True})
