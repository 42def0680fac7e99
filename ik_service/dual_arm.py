"""A whole solve of both arms as one CasADi function, from the request's numbers to the answer's.

    request, options -> answer, report

Each arm descends on its own from the request's q. One that cannot reach its target descends again with a smoothness
that grows with what it misses, so that it follows an unreachable target without haste. Then the answer is measured
against the robot's capsules, and led around what is in the way if that is wanted.

Being one function, it runs in generated C without a detour through Python, and is mapped over batches as it is.
"""

from collections.abc import Sequence

import casadi as ca

from ik_service.arm import BLOCKS, Arm
from ik_service.avoidance import SHORT_PATH, Avoidance
from ik_service.layout import AVOID, OFF, Inputs, report_of
from ik_service.newton import descent, when
from ik_service.objective import MISSED, ArmProblem
from ik_service.robot import Robot


def dual_arm(robot: Robot, arms: Sequence[Arm], inputs: Inputs, avoidance: Avoidance | None) -> ca.Function:
    """Build the solve of a robot.

    Args:
        robot: The robot.
        arms: Its arms' functions.
        inputs: What a solve is told.
        avoidance: Its collision functions; None without pairs to check.

    Returns:
        Function (request, options) -> (answer, report) of vectors as in `layout`.
    """
    split = arms[0].n
    problems, found, reports = [], [], []
    for arm, part, problem in zip(arms, (inputs.q[:split], inputs.q[split:]), inputs.problems, strict=True):
        result, as_solved = _arm_solve(arm)(part, problem, inputs.retreat)
        problems.append(as_solved)
        found.append(result[: arm.n])
        reports.append(result[arm.n :])
    q, state = ca.vertcat(*found), [ca.MX.inf(), ca.MX(-1), ca.MX(0)]
    if avoidance is not None:
        q_start = ca.fmin(ca.fmax(inputs.q, robot.lower), robot.upper)
        checked = _checked(robot, arms, avoidance)
        q, *state = checked(q, q_start, *problems, inputs.base_ends, inputs.collision, inputs.retreat)
    parts = (q[:split], q[split:])
    reports = [
        when(arm.remeasured)(state[2], report, part, problem)
        for arm, report, part, problem in zip(arms, reports, parts, problems, strict=True)
    ]
    outputs = [ca.vertcat(q, inputs.torque(q)), report_of(reports, state)]
    return ca.Function("solve", [inputs.request, inputs.options], outputs)


def _arm_solve(arm: Arm) -> ca.Function:
    """(q, problem, retreat) -> ([q, value, position error, rotation error, iterations, settled], problem as solved)."""
    n, side = arm.n, arm.chain.side
    q, problem, retreat = ca.MX.sym("q", n), ca.MX.sym("problem", arm.problem_size), ca.MX.sym("retreat")
    descend = descent(arm.objective, BLOCKS, f"{side}_descent")

    def solved(problem: ca.MX) -> ca.MX:
        found, value, measures, iterations, settled = descend(q, problem)
        return ca.vertcat(found, value, measures[4:], iterations, settled)

    first = solved(problem)
    weights = ArmProblem.split(problem, n).weights
    error = weights[0] * first[n + 1] ** 2 + weights[1] * first[n + 2] ** 2
    slower = ArmProblem.slowed(problem, n, retreat, error)
    symbol = ca.MX.sym("slower", problem.numel())
    again = ca.Function(f"{side}_again", [ca.MX.sym("first", n + 5), symbol, q], [solved(symbol)])
    result = when(again)(ca.logic_and(retreat > 0.0, error > MISSED), first, slower, q)
    return ca.Function(f"{side}_solve", [q, problem, retreat], [result, slower])


def _checked(robot: Robot, arms: Sequence[Arm], avoidance: Avoidance) -> ca.Function:
    """(q, q_start, problems, base ends, collision, retreat) -> (q, clearance, place of the nearest pair, diverted)."""
    q, q_start, collision = ca.MX.sym("q", robot.nq), ca.MX.sym("q_start", robot.nq), ca.MX.sym("collision")
    problems = [ca.MX.sym(arm.chain.side, arm.problem_size) for arm in arms]
    base_ends = ca.MX.sym("base_ends", avoidance.measure.sparsity_in(1))
    retreat, clearance, place = ca.MX.sym("retreat"), ca.MX.sym("clearance"), ca.MX.sym("place")
    measured = ca.Function("measured", [clearance, place, q, base_ends], [*avoidance.measure(q, base_ends)])
    nearest = when(measured)(collision > OFF, ca.MX.inf(), ca.MX(-1), q, base_ends)
    far = ca.norm_inf(q - q_start) > SHORT_PATH
    doubtful = ca.logic_and(collision == AVOID, ca.logic_or(nearest[0] < robot.collision.margin, far))
    state = when(avoidance.resolve)(doubtful, q, *nearest, ca.MX(0), q_start, *problems, base_ends, retreat)
    return ca.Function("checked", [q, q_start, *problems, base_ends, collision, retreat], list(state))
