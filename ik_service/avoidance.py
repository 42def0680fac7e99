"""Keeping both arms clear of the body and of each other, as CasADi functions.

Where an answer would come too near, or its way is not free, the arms descend together among springs (`springs`) from
the request's q, in steps too short to pass through a limb. Floors of the springs lie a little above the margin; for a
pair that starts nearer, a little above where it starts, so that it opens gently.

What the springs achieve is then checked pair by pair, along the straight path from the request's q: the answer is the
farthest point of that path that is clear, the whole way to it being free of contact.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from ik_service.arm import Arm
from ik_service.newton import descent, when
from ik_service.objective import ArmProblem
from ik_service.proximity import Proximity
from ik_service.robot import Robot
from ik_service.springs import coupled_objective

SLACK = 3e-4
"""How far floors lie above the margin [m]."""

HELD_UP = 1e-2
"""Error part of the cost from which on an arm held up by the body is slowed: 14 mm or 6 degrees of weights 50 and 1."""

OPENING = 3e-3
"""How far a pair that starts below the margin is opened by one answer [m]."""

SHORT_PATH = 0.1
"""Largest joint displacement of an answer whose path is not walked [rad]: between two clear ends of it the hand
could dip by the sagitta of a 50 mm chord around a limb, less than the margin."""

SAMPLES = 24
"""Points of the path that are looked at where it is walked."""

BLOCKS = (4, 2)
"""Nesting of the iterations of the coupled descent after the first: few, since the next request goes on from there."""


@dataclass(frozen=True)
class Avoidance:
    """Functions of collision checking and avoidance.

    Attributes:
        measure: (q, base ends) -> (clearance [m], place of the nearest pair).
        resolve: (q, clearance, place, changed, q_start, problem of the left arm, of the right arm, base ends, retreat)
            -> (q, clearance, place, changed): the answer kept clear.
        coupled: (q_start, problem of `springs.coupled_objective`) -> (q, value, measures, iterations, settled).
    """

    measure: ca.Function
    resolve: ca.Function
    coupled: ca.Function


def avoidance(robot: Robot, arms: Sequence[Arm]) -> Avoidance:
    """Build the functions of a robot that has pairs to check.

    Args:
        robot: The robot.
        arms: Its arms' functions.

    Returns:
        Its functions.
    """
    proximity = Proximity.of(robot)
    q = ca.MX.sym("q", robot.nq)
    base_ends = ca.MX.sym("base_ends", proximity.distances.sparsity_in(1))
    measure = ca.Function("measure", [q, base_ends], list(proximity.nearest(proximity.distances(q, base_ends))))
    coupled = descent(coupled_objective(robot, arms, proximity), BLOCKS, "coupled")
    return Avoidance(measure, _resolve(robot, arms, proximity, measure, coupled), coupled)


def _resolve(
    robot: Robot, arms: Sequence[Arm], proximity: Proximity, measure: ca.Function, coupled: ca.Function
) -> ca.Function:
    nq = robot.nq
    q, q_start, retreat = ca.MX.sym("q", nq), ca.MX.sym("q_start", nq), ca.MX.sym("retreat")
    clearance, place, changed = ca.MX.sym("clearance"), ca.MX.sym("place"), ca.MX.sym("changed")
    base_ends = ca.MX.sym("base_ends", proximity.distances.sparsity_in(1))
    problems = [ca.MX.sym(arm.chain.side, arm.problem_size) for arm in arms]
    walk = when(_walk(robot, proximity))
    detour = when(_detour(robot, arms, proximity, walk, coupled))

    d_start = proximity.distances(q_start, base_ends)
    clear, _ = proximity.clear(proximity.distances(q, base_ends), d_start)
    reached = walk(clear, q_start, q, q_start, d_start, base_ends)
    blocked = ca.norm_inf(reached - q) > 0.0
    answer = detour(blocked, reached, q_start, d_start, *problems, base_ends, retreat)
    inputs = [q, clearance, place, changed, q_start, *problems, base_ends, retreat]
    return ca.Function("resolve", inputs, [answer, *measure(answer, base_ends), ca.norm_inf(answer - q) > 0.0])


def _detour(
    robot: Robot, arms: Sequence[Arm], proximity: Proximity, walk: ca.Function, coupled: ca.Function
) -> ca.Function:
    """(q to be replaced, q_start, d_start, problems, base ends, retreat, longest step) -> what the springs achieve.

    The smoothness of an arm grows with its error at the start: one held up by the body does not rush about.
    """
    nq, margin = robot.nq, robot.collision.margin
    q, q_start, retreat = ca.MX.sym("q", nq), ca.MX.sym("q_start", nq), ca.MX.sym("retreat")
    d_start = ca.MX.sym("d_start", proximity.pairs)
    base_ends = ca.MX.sym("base_ends", proximity.distances.sparsity_in(1))
    problems = [ca.MX.sym(arm.chain.side, arm.problem_size) for arm in arms]
    slowed, split = [], arms[0].n
    for arm, problem, part in zip(arms, problems, (q_start[:split], q_start[split:]), strict=True):
        _, _, _, _, measures = arm.objective.evaluate(part, problem)
        slowed.append(ArmProblem.slowed(problem, arm.n, retreat, measures[1] - HELD_UP))
    floors = ca.fmin(margin + SLACK, d_start + OPENING)
    around, *_ = coupled(q_start, ca.vertcat(*slowed, floors, ca.vec(base_ends)))
    answer = walk(True, q_start, around, q_start, d_start, base_ends)
    stuck = ca.logic_and(ca.norm_inf(answer - q_start) == 0.0, ca.mmin(d_start) < margin)
    opened = when(_opening(robot, arms, proximity, walk, coupled))
    answer = opened(stuck, answer, q_start, d_start, *problems, floors, base_ends)
    inputs = [q, q_start, d_start, *problems, base_ends, retreat]
    return ca.Function("detour", inputs, [answer])


def _opening(
    robot: Robot, arms: Sequence[Arm], proximity: Proximity, walk: ca.Function, coupled: ca.Function
) -> ca.Function:
    """(q to be replaced, q_start, d_start, problems, floors, base ends) -> the nearest posture that opens what touches.

    For starts in contact from which the targets cannot be followed: they do not count.
    """
    q, q_start = ca.MX.sym("q", robot.nq), ca.MX.sym("q_start", robot.nq)
    d_start, floors = ca.MX.sym("d_start", proximity.pairs), ca.MX.sym("floors", proximity.pairs)
    base_ends = ca.MX.sym("base_ends", proximity.distances.sparsity_in(1))
    problems = [ca.MX.sym(arm.chain.side, arm.problem_size) for arm in arms]
    idle = [ArmProblem.idle(problem, arm.n) for arm, problem in zip(arms, problems, strict=True)]
    opened, *_ = coupled(q_start, ca.vertcat(*idle, floors, ca.vec(base_ends)))
    answer = walk(True, q_start, opened, q_start, d_start, base_ends)
    return ca.Function("opening", [q, q_start, d_start, *problems, floors, base_ends], [answer])


def _walk(robot: Robot, proximity: Proximity) -> ca.Function:
    """(q to be replaced, q_end, q_start, d_start, base ends) -> the farthest clear point on the way to q_end.

    A short path is only looked at where it ends; a longer one, and one whose end is not clear, all along.
    """
    nq = robot.nq
    q, q_start, q_end = ca.MX.sym("q", nq), ca.MX.sym("q_start", nq), ca.MX.sym("q_end", nq)
    d_start = ca.MX.sym("d_start", proximity.pairs)
    base_ends = ca.MX.sym("base_ends", proximity.distances.sparsity_in(1))
    step = q_end - q_start
    clear, _ = proximity.clear(proximity.distances(q_end, base_ends), d_start)
    done = ca.logic_and(clear, ca.norm_inf(step) <= SHORT_PATH)
    look = when(_look(robot, proximity))
    share, stopped = ca.MX(0), done
    for k in range(1, SAMPLES + 1):
        share, stopped = look(stopped == 0, share, stopped, k / SAMPLES, q_start, q_end, d_start, base_ends)
    at_end = ca.logic_or(done, share >= 1.0)
    between = ca.fmin(ca.fmax(q_start + share * step, robot.lower), robot.upper)
    answer = ca.if_else(at_end, q_end, between)
    return ca.Function("walk", [q, q_end, q_start, d_start, base_ends], [answer])


def _look(robot: Robot, proximity: Proximity) -> ca.Function:
    """(share, stopped, sample, q_start, q_end, d_start, base ends) -> (share, stopped) after one sample of the path."""
    nq = robot.nq
    share, stopped, sample = ca.MX.sym("share"), ca.MX.sym("stopped"), ca.MX.sym("sample")
    q_start, q_end = ca.MX.sym("q_start", nq), ca.MX.sym("q_end", nq)
    d_start = ca.MX.sym("d_start", proximity.pairs)
    base_ends = ca.MX.sym("base_ends", proximity.distances.sparsity_in(1))
    between = ca.fmin(ca.fmax(q_start + sample * (q_end - q_start), robot.lower), robot.upper)
    q_sample = ca.if_else(sample >= 1.0, q_end, between)
    clear, free = proximity.clear(proximity.distances(q_sample, base_ends), d_start)
    now_stopped = ca.logic_or(stopped, ca.logic_not(free))
    farther = ca.if_else(ca.logic_and(clear, ca.logic_not(now_stopped)), sample, share)
    inputs = [share, stopped, sample, q_start, q_end, d_start, base_ends]
    return ca.Function("look", inputs, [farther, now_stopped])
