"""One attempt at a global solve, as a CasADi function: from a given start to a posture that reaches and is clear.

    start, todo, request, options -> answer, report

An arm that is still to be solved descends from the start; one that is not keeps what the start says. When both arms
have arrived and touch something, they are pushed apart along what the targets leave free. `multistart` tries one start
after the other.
"""

from collections.abc import Sequence

import casadi as ca

from ik_service.arm import Arm
from ik_service.avoidance import Avoidance
from ik_service.layout import AVOID, OFF, Inputs, report_of, split_report
from ik_service.newton import descent, when
from ik_service.objective import ArmProblem
from ik_service.robot import Robot

BLOCKS = (4, 5)
"""Nesting of the iterations after the first of one descent: a start that has not arrived by then is given up."""

SLACK = 1e-4
"""How far springs keep pairs above the margin [m]; they hardly give way where targets can be met."""

ARRIVED = 1.25e-7
"""Error part of the cost of an arm that has arrived: 0.05 mm or 0.02 degrees of weights 50 and 1."""


def attempt(robot: Robot, arms: Sequence[Arm], inputs: Inputs, avoidance: Avoidance | None) -> ca.Function:
    """Build the attempt of a robot.

    Args:
        robot: The robot.
        arms: Its arms' functions.
        inputs: What a solve is told.
        avoidance: Its collision functions; None without pairs to check.

    Returns:
        Function (start, todo, request, options) -> (answer, report): `start` is a q, `todo` one flag an arm, the rest
        is as in `layout`.
    """
    nq, split = robot.nq, arms[0].n
    start, todo = ca.MX.sym("start", nq), ca.MX.sym("todo", 2)
    problems, found, reports = [], [], []
    for i, (arm, part) in enumerate(zip(arms, (start[:split], start[split:]), strict=True)):
        problem = inputs.problems[i]
        measured = arm.remeasured(ca.MX.zeros(5), part, problem)
        result = when(_descent(arm))(todo[i], ca.vertcat(part, measured), problem)
        problems.append(problem)
        found.append(result[: arm.n])
        reports.append(result[arm.n :])
    q, state = ca.vertcat(*found), [ca.MX.inf(), ca.MX(-1), ca.MX(0)]
    if avoidance is not None:
        state[:2] = when(_measured(avoidance, nq))(inputs.collision > OFF, *state[:2], q, inputs.base_ends)
        arrived = ca.logic_and(_error(problems[0], reports[0]), _error(problems[1], reports[1]))
        pushed = when(_pushed(robot, avoidance, problems))
        wanted = ca.logic_and(ca.logic_and(inputs.collision == AVOID, arrived), state[0] < robot.collision.margin)
        q, *state = pushed(wanted, q, *state, *problems, inputs.base_ends)
    reports = [
        when(arm.remeasured)(state[2], report, part, problem)
        for arm, report, part, problem in zip(arms, reports, (q[:split], q[split:]), problems, strict=True)
    ]
    report = report_of(reports, state)
    outputs = [ca.vertcat(q, inputs.torque(q)), report]
    return ca.Function("attempt", [start, todo, inputs.request, inputs.options], outputs)


def _descent(arm: Arm) -> ca.Function:
    """([q, report], problem) -> [q, report]."""
    n, side = arm.n, arm.chain.side
    result, problem = ca.MX.sym("result", n + 5), ca.MX.sym("problem", arm.problem_size)
    descend = descent(arm.objective, BLOCKS, f"{side}_reach")
    q, value, measures, iterations, settled = descend(result[:n], problem)
    outputs = ca.vertcat(q, value, measures[4:], iterations, settled)
    return ca.Function(f"{side}_reached", [result, problem], [outputs])


def _error(problem: ca.MX, report: ca.MX) -> ca.MX:
    """Whether an arm has arrived."""
    n = problem.numel() - ArmProblem.size(0)
    weights, (_, position, rotation, _, _) = ArmProblem.split(problem, n).weights, split_report(report)
    return weights[0] * position**2 + weights[1] * rotation**2 <= ARRIVED


def _measured(avoidance: Avoidance, nq: int) -> ca.Function:
    """(clearance, place, q, base ends) -> (clearance, place)."""
    q, base_ends = ca.MX.sym("q", nq), ca.MX.sym("base_ends", avoidance.measure.sparsity_in(1))
    old = [ca.MX.sym("clearance"), ca.MX.sym("place")]
    return ca.Function("measured_reach", [*old, q, base_ends], [*avoidance.measure(q, base_ends)])


def _pushed(robot: Robot, avoidance: Avoidance, problems: list[ca.MX]) -> ca.Function:
    """(q, clearance, place, diverted, problems, base ends) -> (q, clearance, place, diverted)."""
    q, base_ends = ca.MX.sym("q", robot.nq), ca.MX.sym("base_ends", avoidance.measure.sparsity_in(1))
    old = [ca.MX.sym("clearance"), ca.MX.sym("place"), ca.MX.sym("diverted")]
    symbols = [ca.MX.sym(f"problem{i}", problem.numel()) for i, problem in enumerate(problems)]
    floors = ca.MX(ca.DM.ones(len(robot.collision.pairs)) * (robot.collision.margin + SLACK))
    around, *_ = avoidance.coupled(q, ca.vertcat(*symbols, floors, ca.vec(base_ends)))
    outputs = [around, *avoidance.measure(around, base_ends), ca.MX(1)]
    return ca.Function("pushed", [q, *old, *symbols, base_ends], outputs)
