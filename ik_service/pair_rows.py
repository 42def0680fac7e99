"""How fast motions of the arms close the gaps between capsules, as CasADi functions."""

from functools import cache

import casadi as ca

from ik_service.clearance import Segment, closest, pair_gradient
from ik_service.newton import when
from ik_service.proximity import Proximity
from ik_service.robot import Robot

NEAR = 0.15
"""Clearance above the margin beyond which a pair does not count [m]: at 0.9 m/s it is not too near yet."""

GROUP = 8
"""Pairs that are passed over together when none of them is near."""

MOTIONS = 3
"""Motions that are looked at together."""


def pair_rows(robot: Robot, proximity: Proximity, pairs: range, name: str) -> ca.Function:
    """Build the rows of a run of pairs.

    Args:
        robot: The robot.
        proximity: Its collision functions.
        pairs: Which pairs.
        name: Name of the function.

    Returns:
        Function (d, ends, lines, motions) -> closing: `d` is the clearance of every pair of the robot [m]; ends and
        lines are what `Proximity.shape` gives; motions are joint velocities [rad/s], shape (nq, MOTIONS); `closing` is
        how fast each motion closes the gap of each pair [m/s], shape (MOTIONS, pairs), zero for one that is not near.
    """
    d = ca.MX.sym("d", len(robot.collision.pairs))
    ends, lines = (ca.MX.sym(key, proximity.shape.sparsity_out(i)) for i, key in enumerate(("ends", "lines")))
    motions = ca.MX.sym("motions", robot.nq, MOTIONS)
    row, found = when(_row(robot.nq)), []
    for first in range(pairs.start, pairs.stop, GROUP):
        group = range(first, min(first + GROUP, pairs.stop))
        mine = d[group.start : group.stop]
        block = when(_group(robot, proximity, row, group))
        near = ca.mmin(mine) < robot.collision.margin + NEAR
        found.append(block(near, ca.MX.zeros(MOTIONS, len(group)), mine, ends, lines, motions))
    return ca.Function(name, [d, ends, lines, motions], [ca.horzcat(ca.MX.zeros(MOTIONS, 0), *found)])


def _group(robot: Robot, proximity: Proximity, row: ca.Function, group: range) -> ca.Function:
    """(closing to be replaced, d of the group, ends, lines, motions) -> closing."""
    old, d = ca.MX.sym("old", MOTIONS, len(group)), ca.MX.sym("d", len(group))
    ends, lines = (ca.MX.sym(key, proximity.shape.sparsity_out(i)) for i, key in enumerate(("ends", "lines")))
    motions = ca.MX.sym("motions", robot.nq, MOTIONS)
    columns = []
    for k, pair in enumerate(group):
        a, b = proximity.model.pairs[pair]
        segments = (ends[:, 2 * a : 2 * a + 2], ends[:, 2 * b : 2 * b + 2])
        near = d[k] < robot.collision.margin + NEAR
        columns.append(row(near, old[:, k], *segments, lines, proximity.moves(pair, robot.arms), motions))
    return ca.Function(f"closing_{group[0]}", [old, d, ends, lines, motions], [ca.horzcat(*columns)])


@cache
def _row(nq: int) -> ca.Function:
    """(closing to be replaced, ends of a, ends of b, lines, moves, motions) -> closing of one pair."""
    old, moves = ca.SX.sym("old", MOTIONS), ca.SX.sym("moves", nq)
    lines, motions = ca.SX.sym("lines", 6, nq), ca.SX.sym("motions", nq, MOTIONS)
    ends = [ca.SX.sym(key, 3, 2) for key in ("a", "b")]
    near = closest(*(Segment(e[:, 0], e[:, 1] - e[:, 0], ca.sumsqr(e[:, 1] - e[:, 0])) for e in ends))
    closing = -motions.T @ pair_gradient(near, lines, moves)
    return ca.Function("closing", [old, *ends, lines, moves, motions], [closing], {"cse": True})
