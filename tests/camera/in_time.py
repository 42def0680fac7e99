"""What a robot with limits of speed could do at best of a person's motion: a follower that knows all of it beforehand.

Of an upper arm only the first two joints count. Their way is looked for that has the upper arm like the person's in as
many ticks as can be, under nothing but the limits of position, velocity and acceleration. Nothing is in its way, any
jerk will do, the wrist does not count, and where the person's arm is impossible it may be anywhere. A robot that learns
of each tick only when it comes does less.

The most ticks are found as the least sum of what they are missed by, reweighted to count them (E. Candes, M. Wakin and
S. Boyd, "Enhancing Sparsity by Reweighted l1 Minimization", 2008); directions are linear about the last way found. What
it finds, its joints can do. That need not be the most there are, so it is no proof that what it misses cannot be done.
"""

from collections.abc import Callable

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from skinned_person import Array

ROUNDS = 4
CORNERS = 16
"""Of the polygon that stands for the circle about the person's direction."""
WITHIN = 0.92
"""Share of the circle that the polygon's lines keep to: between its corners, and as directions are not linear."""
NEAR = 0.6
"""How far a round may go from where the directions are linear [rad]."""
COUNTED = 0.03
"""What an angle beyond the circle is small against [rad]: larger ones all count about the same."""
_STEP = 1e-5

_CORNERS = np.stack([np.cos(turns := np.arange(CORNERS) * 2.0 * np.pi / CORNERS), np.sin(turns)], axis=1)


def best_angles(
    direction: Callable[[Array], Array],
    wanted: Array,
    needed: NDArray[np.bool_],
    begin: Array,
    *,
    bounds: tuple[Array, Array],
    most: tuple[float, float],
    period: float,
    within: float,
) -> Array:
    """Follow an upper arm as well as can be.

    Args:
        direction: From the two joints of each tick, shape (n, 2) [rad], to unit vectors, shape (n, 3).
        wanted: Unit directions of the person's upper arm, shape (n, 3).
        needed: In which ticks it is possible, shape (n,).
        begin: Postures of the two joints to begin the search at, shape (n, 2) [rad]; NaN where there is none.
        bounds: Lower and upper limits of the two joints, shape (2,) [rad].
        most: Largest velocity [rad/s] and acceleration [rad/s^2].
        period: Of the ticks [s].
        within: Angle from the person's direction that is like it [rad].

    Returns:
        Angles from the person's direction, shape (n,) [rad]. The joints begin at zero, at rest.
    """
    best, fewest = np.full(len(wanted), np.inf), len(wanted) + 1
    if not needed.any():
        return best
    q, price = _filled(begin), np.ones(len(wanted))
    for k in range(ROUNDS):
        q = _way(direction, wanted, needed, q, price, bounds, most, period, within, np.inf if k == 0 else NEAR)
        angles = np.arccos((direction(q) * wanted).sum(axis=1).clip(-1.0, 1.0))
        missed = int((angles[needed] > within).sum())
        if missed < fewest:
            best, fewest = angles, missed
        price = COUNTED / (np.maximum(angles - within, 0.0) + COUNTED)
    return best


def _way(
    direction: Callable[[Array], Array],
    wanted: Array,
    needed: NDArray[np.bool_],
    about: Array,
    price: Array,
    bounds: tuple[Array, Array],
    most: tuple[float, float],
    period: float,
    within: float,
    near: float,
) -> Array:
    """The way of least price, directions being linear about some way, shape (n, 2) [rad]."""
    n, ticks = len(wanted), np.flatnonzero(needed)
    offset, slope = _lines(direction, wanted, about)
    opti = ca.Opti("conic")
    q, beyond = opti.variable(2, n), opti.variable(len(ticks))
    # Column by column: joints of a tick are next to each other.
    rows = ca.DM(len(ticks) * CORNERS, 2 * n)
    for i, t in enumerate(ticks):
        rows[i * CORNERS : (i + 1) * CORNERS, 2 * t : 2 * t + 2] = slope[t]
    spread = ca.kron(ca.DM.eye(len(ticks)), ca.DM.ones(CORNERS))
    opti.subject_to(rows @ ca.vec(q) - spread @ beyond <= WITHIN * within - offset[ticks].ravel())
    opti.subject_to(beyond >= 0.0)
    lower, upper = (np.tile(bound[:, None], (1, n)) for bound in bounds)
    if np.isfinite(near):
        lower, upper = np.maximum(lower, about.T - near), np.minimum(upper, about.T + near)
    opti.subject_to(opti.bounded(ca.DM(lower), q, ca.DM(upper)))
    before = ca.horzcat(ca.DM.zeros(2, 2), q)
    step = before[:, 1:] - before[:, :-1]
    change = step[:, 1:] - step[:, :-1]
    speed, acceleration = most[0] * period, most[1] * period**2
    opti.subject_to(opti.bounded(-speed, ca.vec(step[:, 1:]), speed))
    opti.subject_to(opti.bounded(-acceleration, ca.vec(change), acceleration))
    opti.minimize(ca.dot(ca.DM(price[ticks]), beyond))
    opti.solver("highs", {"print_time": False, "highs": {"output_flag": False}})
    return np.array(opti.solve().value(q)).reshape(2, n).T


def _lines(direction: Callable[[Array], Array], wanted: Array, about: Array) -> tuple[Array, Array]:
    """How far directions are beyond each corner's side of the person's, shape (n, CORNERS), and the slopes of that.

    Slopes: shape (n, CORNERS, 2); offsets are at joints of zero, as the lines have it.
    """
    u = direction(about)
    slope = np.stack([(direction(about + _STEP * e) - u) / _STEP for e in np.eye(2)], axis=2)
    helper = np.eye(3)[np.abs(wanted).argmin(axis=1)]
    first = np.cross(wanted, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    across = np.stack([first, np.cross(wanted, first)], axis=1)
    u, slope = np.einsum("nij,nj->ni", across, u), across @ slope
    offset = u - np.einsum("nij,nj->ni", slope, about)
    return offset @ _CORNERS.T, _CORNERS @ slope


def _filled(begin: Array) -> Array:
    """With postures between those that are there."""
    ticks = np.arange(len(begin))
    there = np.isfinite(begin).all(axis=1)
    return np.stack([np.interp(ticks, ticks[there], column[there]) for column in begin.T], axis=1)
