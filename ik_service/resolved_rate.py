"""From a wrist's twist to joint velocities, as CasADi expressions: resolved motion rate control of one arm.

The name is D. E. Whitney's ("Resolved Motion Rate Control of Manipulators and Human Prostheses", IEEE Transactions on
Man-Machine Systems 10, 1969). Two laws are offered.

The adaptive one inverts the whole twist, with as much damping as the posture needs: none where the manipulability

    w = sqrt(det(J J^T))

is at least `SINGULAR`, and below it, after Y. Nakamura and H. Hanafusa ("Inverse Kinematic Solutions with Singularity
Robustness for Robot Manipulator Control", Journal of Dynamic Systems, Measurement, and Control 108, 1986),

    q' = s J^T (J J^T + k I)^-1 v,    k = (INNER damping)^2 (1 - w / SINGULAR)^2.

Damping bends the direction, and a hand that goes a wrong way is worse than one that is slow. So most of it is in the
scale s, which slows the whole arm where the joints would move far for a little of the hand:

    s = min(1, (|v| / (damping |q'|))^2)

has the size of sigma^2 / damping^2, as a damped inverse near a singular value sigma, and leaves alone what costs less
than 1 / damping radians a metre. A direction that even so is wrong stops.

An answer is for the period to come, in which the arm goes on. So the adaptive law looks at the arm where it will be in
the middle of it if it keeps its velocity: the midpoint method, whose error is of the second order. At the present
posture a hand at 0.2 m/s would drift by a centimetre and half a degree in a metre, at 50 Hz.

What the twist leaves free is a motion of the arm behind a hand that stands still; its direction comes along.

The fixed law always damps, leaves the orientation free, and has the first joint of the waist among its columns, which
takes its share of the twist although nobody commands it:

    q' = J^T (J J^T + damping^2 I)^-1 v,    without its first row.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ik_proto.limits import SINGULAR_LINEAR, SINGULAR_TWIST
from ik_service.chains import ArmChain, WaistChain
from ik_service.kinematics import WristPose, wrist_pose
from ik_service.ldl import Factors, factorize

LENGTH = 0.3
"""Length that makes a rotation comparable with a translation [m]: about the lever of a hand about its elbow."""

SINGULAR = {"held": SINGULAR_TWIST, "free": SINGULAR_LINEAR}
"""Manipulability below which a posture counts as singular, of the whole twist [m^3] and of its linear part [m^3]."""

INNER = 0.02
"""Share of the damping that goes into the inverse itself: enough to keep it finite, too little to bend the direction
before the hand has all but stopped."""

DEVIATION = (2.0, 3.5)
"""Angle up to which a damped motion goes the right way, and from which on it goes a wrong one [degrees]."""

FORESIGHT = 0.05
"""Farthest that a joint is looked at ahead of where it is [rad]: at 50 Hz the middle of a tick at 5 rad/s."""

FORESEEN = (1.0, 4.0)
"""Multiple of `SINGULAR` up to which nothing is foreseen, and from which on all: near a singular posture the answer
depends on the posture so much that an arm which looks ahead of itself would chatter."""

STILL = 5e-4
"""A hand that moves no faster counts as standing still [m/s]; likewise one at `STILL_SHARE` of the wanted speed."""

STILL_SHARE = 0.01

LEAK = 0.25
"""Share of that speed that the motion along the free direction may give the hand where the inverse is damped."""

IDLE_BELOW = 0.05
"""Speed of the hand below which the posture is left alone the more the slower it is [m/s]: nothing moves unasked."""

IDLE_BELOW_JOINTS = 0.25
"""The same of the arm, Euclidean norm over the joints [rad/s]."""

POSTURE_SPEED = 0.5
"""Fastest motion towards the posture, Euclidean norm over the joints [rad/s]."""

ROUNDING = 1e-14
"""Added to the diagonal of J J^T, which keeps 0/0 out of the factorization of a singular one [m^2]."""

_TINY = 1e-9

SHORT = 1e-4
"""What is left to do that counts as nothing [rad]: there the free motion fades instead of turning about."""

SETTINGS = ("hand_frame", "held", "fixed", "damping", "max_speed", "posture_gain")
"""What the laws are told beside the twist: whether it is in the hand's frame and whether the orientation is held (of
each arm), whether the law is the fixed one, its damping, the largest joint speed [rad/s], and how much of the way to
the posture is made in a second [1/s]."""


Expression = Any
"""SX where the laws are written, MX where they are called."""


@dataclass(frozen=True)
class Resolved:
    """What a twist comes to; the outputs of `resolved_rate`, in this order.

    Joint velocities are `s task + a free`, with 0 <= s <= `most` and |a| <= `most_free`.

    Attributes:
        task: Joint velocities of the whole twist, uniformly slowed to the largest joint speed [rad/s], shape (n,).
        free: Unit direction of the motion that leaves the hand where it is, shape (n,); zero where there is none.
        wish: How fast the posture would like to move along `free` [rad/s].
        most: Largest share of `task` whose direction is right.
        most_free: Largest speed along `free` that leaves the hand still [rad/s].
        slowed: What the largest joint speed left of the twist, in [0, 1].
        damped: What damping left of it.
        worth: w^2 / SINGULAR^2 - 1: above zero where the posture is not singular.
        worth_gradient: Its gradient [1/rad], shape (n,).
        manipulability: w [m^3].
        damping: Square root of k, of the scaled Jacobian [m].
        position: Wrist in the base frame [m], shape (3,).
        jacobian: Joint velocities to the twist in its own frame, shape (6, n).
        jacobian_base: Joint velocities to the wrist's linear velocity in the base frame, shape (3, n).
    """

    task: Expression
    free: Expression
    wish: Expression
    most: Expression
    most_free: Expression
    slowed: Expression
    damped: Expression
    worth: Expression
    worth_gradient: Expression
    manipulability: Expression
    damping: Expression
    position: Expression
    jacobian: Expression
    jacobian_base: Expression


def resolved_rate(chain: ArmChain, waist: WaistChain) -> ca.Function:
    """Build the laws of an arm.

    Args:
        chain: The arm, of n joints.
        waist: The waist that carries it.

    Returns:
        Function (q, twist, settings, posture, R, p) -> fields of `Resolved`. The twist is linear [m/s], then angular
        [rad/s]; R and p are the motion of the waist.
    """
    n = chain.n
    q, twist, posture = ca.SX.sym("q", n), ca.SX.sym("twist", 6), ca.SX.sym("posture", n)
    settings, R, p = ca.SX.sym("settings", len(SETTINGS)), ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3)
    hand_frame, held, fixed, damping, max_speed, gain = ca.vertsplit(settings)

    # Everything is worked out in the frame that the waist carries; the twist comes there, and what it comes to goes
    # back.
    pose = wrist_pose(chain, q)
    linear, angular = ca.horzcat(*pose.levers), ca.horzcat(*pose.axes)
    back = ca.if_else(hand_frame, pose.R.T, R)
    v, omega = back.T @ twist[:3], held * (back.T @ twist[3:])
    J, square = _jacobian(pose, held)
    wanted = ca.vertcat(v, LENGTH * omega)

    singular = _singular(held)
    determinant = _determinant(square)
    worth = determinant / singular**2 - 1.0
    w = ca.sqrt(ca.fmax(determinant, 0.0))
    k = (INNER * damping * ca.fmax(1.0 - w / singular, 0.0)) ** 2
    factors = factorize(_rows(square + (k + ROUNDING) * ca.SX.eye(6)))
    adaptive = J.T @ ca.vertcat(*factors.solve(ca.vertsplit(wanted)))

    column = _waist_column(waist, pose.p, R, p)
    speed = ca.norm_2(wanted)
    effort = damping * ca.norm_2(adaptive)
    damped = ca.if_else(fixed, 1.0, ca.fmin(1.0, ((speed + _TINY) / ca.fmax(effort, _TINY)) ** 2))
    task = ca.if_else(fixed, _fixed_law(linear, column, v, damping), damped * adaptive)
    slowed = ca.fmin(1.0, max_speed / (ca.norm_inf(task) + _TINY))
    task *= slowed

    towards = posture - q
    free = (1.0 - fixed) * _free_direction(J, factors, towards, ca.logic_and(held, w >= singular))
    stuck = ca.fmax(1.0 - w / singular, 0.0) * ca.fmin(1.0, speed / IDLE_BELOW)
    wish = gain * ca.fmax(ca.fmin(1.0, ca.norm_2(task) / IDLE_BELOW_JOINTS), stuck) * ca.dot(free, towards)
    still = ca.fmin(STILL, STILL_SHARE * speed)
    most = ca.if_else(fixed, 1.0, _rightly_directed(J @ task, wanted, speed, still))

    per_length = LENGTH ** (3.0 * held)
    outputs = Resolved(
        task=task,
        free=free,
        wish=ca.fmin(ca.fmax(wish, -POSTURE_SPEED), POSTURE_SPEED),
        most=most,
        most_free=ca.fmin(max_speed, LEAK * still / (ca.norm_2(J @ free) + _TINY)),
        slowed=slowed,
        damped=damped,
        worth=ca.if_else(fixed, 1.0 / _TINY, worth),
        worth_gradient=ca.gradient(worth, q),
        manipulability=w / per_length,
        damping=ca.if_else(
            fixed, damping, ca.sqrt(k + (1.0 / damped - 1.0) * (damping * speed / ca.fmax(effort, _TINY)) ** 2)
        ),
        position=p + R @ pose.p,
        jacobian=ca.vertcat(back @ linear, back @ angular),
        jacobian_base=R @ linear,
    )
    inputs = [q, twist, settings, posture, R, p]
    return ca.Function(f"{chain.side}_resolved", inputs, list(vars(outputs).values()), {"cse": True})


def q_ahead(chain: ArmChain) -> ca.Function:
    """(q, dq, period, held, fixed) -> joint positions at which the laws look: those of the middle of the period."""
    q, dq = ca.SX.sym("q", chain.n), ca.SX.sym("dq", chain.n)
    period, held, fixed = (ca.SX.sym(key) for key in ("period", "held", "fixed"))
    step = 0.5 * period * dq
    step *= ca.fmin(1.0, FORESIGHT / ca.fmax(ca.norm_inf(step), _TINY))
    _, square = _jacobian(wrist_pose(chain, q), held)
    times_singular = ca.sqrt(ca.fmax(_determinant(square), 0.0)) / _singular(held)
    nothing, all_of_it = FORESEEN
    share = ca.fmax(ca.fmin((times_singular - nothing) / (all_of_it - nothing), 1.0), 0.0)
    inputs = [q, dq, period, held, fixed]
    return ca.Function(f"{chain.side}_ahead", inputs, [q + (1.0 - fixed) * share * step], {"cse": True})


def _jacobian(pose: WristPose, held: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Jacobian of what is controlled, rotations scaled by `LENGTH`, and its square; of rows left free, a unit one."""
    J = ca.vertcat(ca.horzcat(*pose.levers), LENGTH * held * ca.horzcat(*pose.axes))
    return J, J @ J.T + ca.diag(ca.vertcat(ca.SX.zeros(3), ca.repmat(1.0 - held, 3)))


def _singular(held: ca.SX) -> ca.SX:
    """Manipulability of the scaled Jacobian below which a posture counts as singular."""
    return ca.if_else(held, SINGULAR["held"] * LENGTH**3, SINGULAR["free"])


def _determinant(A: ca.SX) -> ca.SX:
    """Determinant of a positive semidefinite matrix."""
    product = ca.SX(1)
    for pivot in factorize(_rows(A + ROUNDING * ca.SX.eye(A.shape[0]))).pivots:
        product *= pivot
    return product


def _free_direction(J: ca.SX, factors: Factors, towards: ca.SX, one: ca.SX) -> ca.SX:
    """Unit direction of a motion that leaves the hand where it is, or nearly so where J is damped.

    Where there is but one such direction, the projection of any vector gives it, and of two the longer one is taken, so
    that it does not vanish. Where there are more, it is the one to the posture; once there, it fades.
    """

    def without_twist(direction: ca.SX) -> ca.SX:
        return direction - J.T @ ca.vertcat(*factors.solve(ca.vertsplit(J @ direction)))

    n = J.shape[1]
    first, second = (without_twist(ca.SX(entries)) for entries in (np.ones(n), (-1.0) ** np.arange(n)))
    longer = ca.if_else(ca.sumsqr(first) > ca.sumsqr(second), first, second)
    way = ca.if_else(one, longer, without_twist(towards))
    return way / (ca.norm_2(way) + ca.if_else(one, _TINY, SHORT))


def _rightly_directed(achieved: ca.SX, wanted: ca.SX, speed: ca.SX, still: ca.SX) -> ca.SX:
    """Largest share of a motion that goes the wanted way, or hardly moves the hand."""
    way = wanted / (speed + _TINY)
    along = ca.dot(achieved, way)
    aside = ca.norm_2(achieved - along * way)
    right, wrong = (np.tan(np.radians(angle)) for angle in DEVIATION)
    share = (wrong * along - aside) / ((wrong - right) * ca.fmax(along, _TINY))
    return ca.fmax(ca.fmin(share, 1.0), ca.fmin(1.0, (still + _TINY) / ca.fmax(aside, _TINY)))


def _fixed_law(linear: ca.SX, column: ca.SX, v: ca.SX, damping: ca.SX) -> ca.SX:
    J = ca.horzcat(column, linear)
    factors = factorize(_rows(J @ J.T + damping**2 * ca.SX.eye(3)))
    return linear.T @ ca.vertcat(*factors.solve(ca.vertsplit(v)))


def _waist_column(waist: WaistChain, position: ca.SX, R: ca.SX, p: ca.SX) -> ca.SX:
    """How the waist's first joint moves the wrist, in the frame it carries [m/rad]; not at all without a waist."""
    if not waist.joint_names:
        return ca.SX.zeros(3)
    origin, axis = waist.placements[0][:3, 3], waist.placements[0][:3, :3] @ waist.axes[0]
    return R.T @ ca.cross(ca.SX(axis), R @ position + p - origin)


def _rows(A: ca.SX) -> list[list[ca.SX]]:
    return [ca.horzsplit(row) for row in ca.vertsplit(A)]
