"""Distances between capsules and their gradients, in CasADi.

The distance of two capsules is that of their axes less both radii: negative in penetration, and with a direction
there too, until the axes themselves meet. The expressions have no branches, so that they compile to straight C, and
give no NaN for any finite input.

Points are in the mount frame of `collision`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ik_service.collision import Capsule, Carrier, CollisionModel
from ik_service.kinematics import WristPose

TINY = 1e-300
"""Added to divisors and under the square root, so that 0/0 becomes 0; far below anything that float64 rounding leaves
of lengths in metres."""


@dataclass(frozen=True)
class Segment:
    """The axis of a capsule.

    Attributes:
        start: One end [m], shape (3,).
        along: From there to the other end [m], shape (3,).
        square: Squared length [m^2]; a number where it is known beforehand.
    """

    start: ca.SX
    along: ca.SX
    square: ca.SX | float


@dataclass(frozen=True)
class Closest:
    """Where two segments a and b are closest.

    Attributes:
        distance: Distance of the two axes [m].
        normal: Unit vector from the point on b to the point on a, shape (3,); zero where the axes meet.
        point_a: Closest point on a [m], shape (3,).
        point_b: Closest point on b [m], shape (3,).
    """

    distance: ca.SX
    normal: ca.SX
    point_a: ca.SX
    point_b: ca.SX


def joint_lines(pose: WristPose) -> ca.SX:
    """The joint axes of an arm as lines in space, in Plücker coordinates.

    Args:
        pose: Kinematics of the arm, of n joints.

    Returns:
        A column a joint: unit direction a and moment o x a about the origin [m], shape (6, n).
    """
    pairs = zip(pose.origins, pose.axes, strict=True)
    return ca.horzcat(*(ca.vertcat(axis, ca.cross(origin, axis)) for origin, axis in pairs))


def capsule_ends(model: CollisionModel, left_pose: WristPose, right_pose: WristPose, base_ends: ca.SX) -> list[Segment]:
    """Axes of all capsules at given joint positions.

    Args:
        model: The capsules.
        left_pose: Kinematics of the left arm.
        right_pose: Kinematics of the right arm.
        base_ends: Ends of the base's capsules in the mount frame [m], shape (3, 2 count): the transpose of what
            `CollisionModel.base_ends` returns, start and end of each side by side.

    Returns:
        One segment a capsule, in the order of the model.
    """
    poses, segments, base = {Carrier.LEFT: left_pose, Carrier.RIGHT: right_pose}, [], 0
    for capsule in model.capsules:
        along = capsule.end - capsule.start
        if capsule.carrier is Carrier.BASE:
            start = base_ends[:, base]
            segments.append(Segment(start, base_ends[:, base + 1] - start, _square(capsule)))
            base += 2
        elif capsule.carrier is Carrier.TORSO:
            segments.append(Segment(_constant(capsule.start), _constant(along), _square(capsule)))
        else:
            pose = poses[capsule.carrier]
            R = pose.rotations[capsule.joint]
            start = pose.origins[capsule.joint] + R @ _constant(capsule.start)
            segments.append(Segment(start, R @ _constant(along), _square(capsule)))
    return segments


def closest(a: Segment, b: Segment) -> Closest:
    """Closest points of two segments.

    The point a(s) closest to the line of b, clamped to the segment; the point b(t) closest to that, clamped; and again
    the point on a closest to that, clamped. This is exact: see C. Ericson, "Real-Time Collision Detection", 2005,
    5.1.9. For parallel segments, where s is arbitrary, and for points the last two steps find a closest pair whatever
    s the first one took.

    Args:
        a: A segment, or a point for one of no length.
        b: Another.

    Returns:
        Distance, direction and points.
    """
    between = a.start - b.start
    a_between, b_between = ca.dot(a.along, between), ca.dot(b.along, between)
    a_b = ca.dot(a.along, b.along)
    # By cross products, though |a|^2 |b|^2 - (a.b)^2 and its like cost less: of nearly parallel segments those are all
    # rounding, and the distance would be off by some 1e-9 m.
    across = ca.cross(a.along, b.along)
    s = _share(ca.dot(across, ca.cross(b.along, between)), ca.sumsqr(across))
    t = _share(a_b * s + b_between, b.square)
    s = _share(a_b * t - a_between, a.square)
    apart = between + s * a.along - t * b.along
    distance = ca.sqrt(ca.sumsqr(apart) + TINY)
    return Closest(distance, apart / distance, a.start + s * a.along, b.start + t * b.along)


def pair_distances(model: CollisionModel, segments: Sequence[Segment]) -> ca.SX:
    """Clearance of every checked pair.

    Args:
        model: Capsules and pairs.
        segments: Axes of the capsules, in the order of the model.

    Returns:
        Distance of the capsules of each pair, radii taken off [m], shape (pairs,).
    """
    radii = [capsule.radius for capsule in model.capsules]
    return ca.vertcat(*(closest(segments[i], segments[j]).distance - (radii[i] + radii[j]) for i, j in model.pairs))


def smallest(values: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Smallest entry of a vector and its place, the first of equals.

    By rounds of a tournament, which a processor plays side by side; a running minimum would wait for every comparison.

    Args:
        values: Shape (n,), n >= 1.

    Returns:
        The entry and its place.
    """
    players = [(values[k], ca.SX(k)) for k in range(values.numel())]
    while len(players) > 1:
        winners = []
        for (value, place), (rival, rivals_place) in zip(players[::2], players[1::2], strict=False):
            winners.append((ca.fmin(value, rival), ca.if_else(rival < value, rivals_place, place)))
        players = winners + players[2 * len(winners) :]
    return players[0]


def pair_gradient(near: Closest, lines: ca.SX, moves: ca.SX) -> ca.SX:
    """Gradient of a pair's distance in the joints of both arms.

    To first order only the motion of the closest points along the normal counts. A joint of axis a through o moves the
    point p by a x (p - o), which along n is a . (p x n) + n . (o x a): the product of the joint's line and the
    normal's. Points on both sides of the normal share its line, and a joint that moves both capsules changes nothing.

    Args:
        near: Where the axes of the pair are closest.
        lines: `joint_lines` of both arms side by side, shape (6, n).
        moves: How each joint counts: 1 moves the first capsule, -1 the second, 0 both or none, shape (n,).

    Returns:
        Derivatives [m/rad], shape (n,).
    """
    normal_line = ca.vertcat(ca.cross(near.point_a, near.normal), near.normal)
    return ca.vertcat(*(moves[i] * ca.dot(lines[:, i], normal_line) for i in range(lines.shape[1])))


def clearances(model: CollisionModel) -> ca.Function:
    """Make the function that measures all checked pairs.

    Args:
        model: Capsules and pairs.

    Returns:
        ends (3, 2 capsules) -> distances (pairs,): ends [m] are starts and ends of the capsules side by side.
    """
    ends = ca.SX.sym("ends", 3, 2 * len(model.capsules))
    return ca.Function("clearances", [ends], [pair_distances(model, _segments(ends))], ["ends"], ["distances"])


def _segments(ends: ca.SX) -> list[Segment]:
    return [_segment(ends[:, k], ends[:, k + 1]) for k in range(0, ends.shape[1], 2)]


def _segment(start: ca.SX, end: ca.SX) -> Segment:
    along = end - start
    return Segment(start, along, ca.sumsqr(along))


def _share(numerator: ca.SX, denominator: ca.SX | float) -> ca.SX:
    """A quotient clamped to [0, 1]."""
    return ca.fmin(ca.fmax(numerator / (denominator + TINY), 0.0), 1.0)


def _square(capsule: Capsule) -> float:
    return float(np.sum((capsule.end - capsule.start) ** 2))


def _constant(values: np.ndarray) -> ca.SX:
    return ca.SX(ca.sparsify(ca.DM(values)))
