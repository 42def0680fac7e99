"""Velocity dampers: how fast a bound may be approached, and the farthest motion that approaches none too fast.

A damper lets the distance d to a bound shrink by no more than `RATE` d a second (B. Faverjon and P. Tournassoud, "A
Local Based Approach for Path Planning of Manipulators with a High Number of Degrees of Freedom", IEEE ICRA 1987). The
bound is approached ever more slowly and not passed; motion away from it, and beside it, is free.

Each bound is a row: a motion of share s of the task and speed f along the free direction approaches it by
`task s + free f`, which may be `most` at the most. Rows allow standing still, so `most` is never negative.
"""

from dataclasses import dataclass
from functools import cache

import casadi as ca

from ik_service.newton import when

RATE = 6.0
"""How much of a distance may be used up in a second [1/s]; of a 50 Hz tick, an eighth."""

RESERVE = 1e-3
"""How much earlier the farthest motion stops than its bound [rad, m]: what the check after it forgives."""

FLAT = 1e-6
"""A row along which the free motion is slower than this cannot be helped by it."""

ROUNDING = 1e-8
"""Speed that counts as none [rad/s, m/s]."""

AWAY = 1e9
"""A bound that bounds nothing [rad/s]."""

APART = 1e-6
"""Distance of two shares between which the slope is taken."""

STEPS = 10
"""Most steps of a search; it ends by itself after two or three."""

PRICE = 0.25
"""What the free motion costs beside what it gains: it helps where it is worth its speed."""

SETTLED = 1e-6
"""Derivative that counts as zero."""


def damper(distance: ca.SX, braking: ca.SX | None = None) -> ca.SX:
    """How fast a bound may be approached.

    Args:
        distance: To the bound [rad, m]; negative beyond it.
        braking: Largest deceleration that the approach may ask for [rad/s^2, m/s^2]; None for any.

    Returns:
        Speed, zero at the bound and beyond.
    """
    d = ca.fmax(distance, 0.0)
    if braking is None:
        return RATE * d
    # Far off the parabola of even braking, near by its tangent that ends in the bound.
    near = braking / RATE**2
    return ca.if_else(d <= near, RATE * d, ca.sqrt(braking * ca.fmax(2.0 * d - near, 0.0)))


@dataclass(frozen=True)
class Farthest:
    """The farthest motion; the outputs of `farthest`, in this order.

    Attributes:
        share: Largest share of the task that approaches no bound too fast.
        free: Speed along the free direction that goes with it, the nearest to the wish.
        place: The row that keeps the share from being larger; meaningless where nothing does.
    """

    share: ca.MX
    free: ca.MX
    place: ca.MX


@cache
def farthest(rows: int) -> ca.Function:
    """Build the search for the farthest motion within some rows.

    At a share s every row leaves an interval of free speeds, and the width of what all leave is a concave function of s
    that is not negative at zero. Newton's method from above finds the last s where there is room in finitely many
    steps, since the function is made of straight pieces.

    There the free motion may have to go fast for a hair more of the task, and the other way a moment later. So of all
    possible motions the one is taken with the least (1 - s)^2 + `PRICE` (f - s wish)^2 / speed^2, which does not jump.
    What is wished for shrinks with the task: an arm that is held up does not go on wandering.

    Args:
        rows: How many rows.

    Returns:
        Function (task, free, most, wish, most free speed, speed of the task) -> fields of `Farthest`.
    """
    task, free, most = (ca.MX.sym(key, rows) for key in ("task", "free", "most"))
    wish, most_free, speed = (ca.MX.sym(key) for key in ("wish", "most_free", "speed"))
    fastest = ca.vertcat(most_free, ca.fabs(wish) + speed)
    ends = _ends(rows)
    alone, *lines = _prepared(rows)(task, free, most)
    last = _last(rows, _width(rows, ends))(alone, wish, *lines, fastest)
    as_wished = _last(rows, _slack(rows, ends))(last, wish, *lines, fastest)
    settle = when(_settle(rows, _keen(rows, ends)))
    price = PRICE / (speed**2 + ROUNDING)
    share = settle(as_wished < last, last, as_wished, wish, price, *lines, fastest)
    along = _clamped(ends, share, wish, lines, fastest)
    left = _left(rows)(share, along, task, free, most)
    outputs = [share, along, ca.find(left <= ca.mmin(left))]
    return ca.Function("farthest", [task, free, most, wish, most_free, speed], outputs)


def held_back(motion: ca.SX, most: ca.SX) -> ca.SX:
    """Largest uniform scale at which a motion approaches no bound too fast.

    Args:
        motion: How fast it approaches each bound, shape (rows,).
        most: How fast it may, likewise.

    Returns:
        A number in [0, 1].
    """
    scale = ca.SX(1)
    for i in range(motion.numel()):
        allowed = most[i] + ROUNDING
        scale = ca.fmin(scale, allowed / ca.fmax(motion[i], allowed))
    return scale


def _prepared(rows: int) -> ca.Function:
    """(task, free, most) -> share that the rows allow which no free motion helps, and the lines that the others are.

    Lines are offset and slope, over the share, of the largest free speed that each row allows, and of the smallest; a
    row that does not bound it is a line far away.
    """
    task, free, most = (ca.SX.sym(key) for key in ("task", "free", "most"))
    room = ca.fmax(most - RATE * RESERVE, 0.0)
    flat = ca.fabs(free) <= FLAT
    alone = (room + ROUNDING) / ca.fmax(task * flat, room + ROUNDING)
    inverse = (1.0 - flat) / (free + flat)
    up, down = inverse * (free > 0.0), inverse * (free < 0.0)
    far = [AWAY * (1.0 - (free > FLAT)), -AWAY * (1.0 - (free < -FLAT))]
    line = [room * up + far[0], -task * up, room * down + far[1], -task * down]
    each = ca.Function("prepared_row", [task, free, most], [alone, *line]).map(rows)
    vectors = [ca.MX.sym(key, rows) for key in ("task", "free", "most")]
    alone, *lines = (row.T for row in each(*(vector.T for vector in vectors)))
    return ca.Function("prepared", vectors, [ca.mmin(alone), *lines])


def _line_symbols(rows: int) -> list[ca.MX]:
    """Symbols of what `_prepared` returns, and of the bounds of the free speed."""
    lines = [ca.MX.sym(key, rows) for key in ("up", "up_slope", "down", "down_slope")]
    return [*lines, ca.MX.sym("fastest", 2)]


def _ends(rows: int) -> ca.Function:
    """(share, lines, fastest) -> (smallest, largest) free speed that the rows leave."""
    share, (up, up_slope, down, down_slope, fastest) = ca.MX.sym("share"), _line_symbols(rows)
    # The free motion helps with no more speed than the task has itself.
    most = ca.fmin(fastest[0], share * fastest[1])
    lower, upper = ca.mmax(down + share * down_slope), ca.mmin(up + share * up_slope)
    inputs = [share, up, up_slope, down, down_slope, fastest]
    return ca.Function("ends", inputs, [ca.fmax(lower, -most), ca.fmin(upper, most)])


def _width(rows: int, ends: ca.Function) -> ca.Function:
    """(share, wish, lines, fastest) -> width of what the rows leave."""
    share, wish, lines = ca.MX.sym("share"), ca.MX.sym("wish"), _line_symbols(rows)
    lower, upper = ends(share, *lines)
    return ca.Function("width", [share, wish, *lines], [upper - lower + ROUNDING])


def _slack(rows: int, ends: ca.Function) -> ca.Function:
    """(share, wish, lines, fastest) -> how far within what the rows leave the wish is."""
    share, wish, lines = ca.MX.sym("share"), ca.MX.sym("wish"), _line_symbols(rows)
    lower, upper = ends(share, *lines)
    return ca.Function("slack", [share, wish, *lines], [ca.fmin(upper - share * wish, share * wish - lower) + ROUNDING])


def _clamped(ends: ca.Function, share: ca.MX, wish: ca.MX, lines: list[ca.MX], fastest: ca.MX) -> ca.MX:
    lower, upper = ends(share, *lines, fastest)
    return ca.fmin(ca.fmax(share * wish, lower), upper)


def _last(rows: int, room: ca.Function) -> ca.Function:
    """(share, wish, lines, fastest) -> the last share up to that one at which there is room, by Newton's method.

    On a straight piece a difference quotient is the slope; across a corner it is one in between.
    """
    share, wish, lines = ca.MX.sym("share"), ca.MX.sym("wish"), _line_symbols(rows)
    now = ca.MX.sym("now")
    slope = (now - room(share - APART, wish, *lines)) / APART
    less = ca.fmax(share - now / ca.fmin(slope, -ROUNDING), 0.0)
    inputs = [share, now, wish, *lines]
    once = when(ca.Function(f"{room.name()}_newton", inputs, [less, room(less, wish, *lines)]))
    state = [share, room(share, wish, *lines)]
    for _ in range(STEPS):
        state = list(once(ca.logic_and(state[1] < 0.0, state[0] > 0.0), *state, wish, *lines))
    return ca.Function(f"last_{room.name()}", [share, wish, *lines], [state[0]])


def _keen(rows: int, ends: ca.Function) -> ca.Function:
    """(share, wish, price, lines, fastest) -> half the derivative of what is to be the least."""
    share, wish, price = (ca.MX.sym(key) for key in ("share", "wish", "price"))
    *lines, fastest = _line_symbols(rows)
    off, before = (_clamped(ends, s, wish, lines, fastest) - s * wish for s in (share, share - APART))
    keen = share - 1.0 + price * off * (off - before) / APART
    return ca.Function("keen", [share, wish, price, *lines, fastest], [keen])


def _settle(rows: int, keen: ca.Function) -> ca.Function:
    """(largest share, largest share with the wish, wish, price, lines, fastest) -> share that is the best.

    That is where the derivative vanishes, or the largest share. By the Illinois method (M. Dowell and P. Jarratt, "A
    modified regula falsi method for computing the root of an equation", BIT 11, 1971), which is exact as soon as both
    ends are on one straight piece.
    """
    last, first, wish, price = (ca.MX.sym(key) for key in ("last", "first", "wish", "price"))
    lines = _line_symbols(rows)
    at_last = keen(last, wish, price, *lines)
    once = when(_illinois(rows, keen))
    state = [first, first - 1.0, last, at_last]
    for _ in range(STEPS):
        going_on = ca.logic_and(at_last > 0.0, ca.fabs(state[3]) > SETTLED)
        state = list(once(going_on, *state, wish, price, *lines))
    return ca.Function("settle", [last, first, wish, price, *lines], [state[2]])


def _illinois(rows: int, keen: ca.Function) -> ca.Function:
    """(one end, derivative there, the other, derivative there, wish, price, lines, fastest) -> the same, a step on."""
    state = [ca.MX.sym(key) for key in ("first", "at_first", "second", "at_second")]
    wish, price, (*lines, fastest) = ca.MX.sym("wish"), ca.MX.sym("price"), _line_symbols(rows)
    first, at_first, second, at_second = state
    between = (first * at_second - second * at_first) / (at_second - at_first)
    at = keen(between, wish, price, *lines, fastest)
    crossed = at * at_second < 0.0
    outputs = [ca.if_else(crossed, second, first), ca.if_else(crossed, at_second, 0.5 * at_first), between, at]
    return ca.Function("illinois", [*state, wish, price, *lines, fastest], outputs)


def _left(rows: int) -> ca.Function:
    """(share, speed, task, free, most) -> how much farther each row would let the share go."""
    share, speed, task, free, most = (ca.SX.sym(key) for key in ("share", "speed", "task", "free", "most"))
    room = ca.fmax(most - RATE * RESERVE, 0.0)
    # What does not go against a row is as far as can be.
    farther = (room - task * share - free * speed) / ca.fmax(task, ROUNDING) + AWAY * (1.0 - (task > ROUNDING))
    each = ca.Function("left_of_row", [share, speed, task, free, most], [farther]).map(rows)
    inputs = [ca.MX.sym(key) for key in ("share", "speed")] + [ca.MX.sym(key, rows) for key in ("task", "free", "most")]
    repeated = [ca.repmat(value, 1, rows) for value in inputs[:2]]
    return ca.Function("left", inputs, [each(*repeated, *(vector.T for vector in inputs[2:])).T])
