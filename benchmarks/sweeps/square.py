"""Squares of 30 cm that a hand is led round by velocity alone, and how far it strays.

Nothing corrects the hand: each side is a command that rises, stays and falls again, as a stick does that is pushed and
let go, and that amounts to 30 cm. Whatever the rate control adds or leaves out stays in the path.

The squares were found by solving along many of them with the orientation fixed: planes, centres and orientations. They
are at least 0.1 rad from every joint limit, four times as far from a singular posture as what counts as one, and clear
of the body. Of upright squares there are many; among 36,000 flat ones, anywhere before the body and with the hand
turned every way, there was none whose four sides an arm reaches without turning its hand.
"""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from benchmarks.sweeps.courses import HOME, MIRROR, MIRROR_JOINTS
from ik_service.robot import Robot
from ik_service.velocity import RateController

SIDE = 0.3
"""Length of a side [m]."""

PERIOD = 0.02
RAMP = 0.3
"""How long the command takes to rise, and to fall [s]."""

PAUSE = 0.2
"""Time from one side to the next without a command [s]."""

Y, Z, X = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class Square:
    """A way round a square, from its lowest inner corner.

    Attributes:
        name: Its name.
        arm: 0 for the left arm, 1 for the right.
        posture: Joint positions of that arm at the corner [rad], shape (7,).
        sides: Directions of the first two sides, shape (2, 3).
        speed: Speed of the hand that is asked for on each side [m/s].
        max_speed: Largest speed of a joint [rad/s].
    """

    name: str
    arm: int
    posture: np.ndarray
    sides: np.ndarray
    speed: float = 0.15
    max_speed: float = 1.5


LEFT = (
    Square("before the chest", 0, np.array([-1.224, 0.448, -1.554, 0.17, -0.939, 0.096, 0.878]), np.array([Z, Y])),
    Square("nearer the middle", 0, np.array([-1.379, 0.27, -1.578, 0.361, -1.077, 0.242, 0.301]), np.array([Z, Y])),
    Square("beside the body", 0, np.array([-0.429, 0.124, 2.215, -0.265, 0.155, -0.55, -1.336]), np.array([Z, X])),
)


def squares() -> list[Square]:
    """All squares of both arms, and the first of them faster."""
    right = [replace(one, arm=1, posture=one.posture * MIRROR_JOINTS, sides=one.sides * MIRROR[:3]) for one in LEFT]
    both = [*LEFT, *right]
    faster = [replace(one, speed=0.2) for one in (LEFT[0], right[0])]
    return [*both, *faster, *(replace(one, speed=0.3, max_speed=3.0) for one in faster)]


@dataclass(frozen=True)
class Round:
    """What the hand did.

    Attributes:
        path_error: Largest distance from the square's outline [m].
        corner_error: Largest distance from a corner where one side ends, the return to the first among them [m].
        drift: Largest change of the orientation [degrees].
        speed: Fastest joint [rad/s].
        acceleration: Largest change of a joint's speed [rad/s^2].
        room: Smallest distance of a joint to its limits [rad].
        manipulability: Smallest of the way [m^3].
        limited: What limited the arm on the way.
        path: Way of the hand in the plane of the square, relative to its first corner [m], shape (ticks, 2).
    """

    path_error: float
    corner_error: float
    drift: float
    speed: float
    acceleration: float
    room: float
    manipulability: float
    limited: list[str]
    path: np.ndarray


def drive_round(robot: Robot, control: RateController, square: Square) -> Round:
    """Lead the hand round from rest, the other hand at rest.

    Args:
        robot: The robot.
        control: Answers.
        square: The way.

    Returns:
        What the hand did.
    """
    arm, half = square.arm, slice(7 * square.arm, 7 * square.arm + 7)
    q, dq = HOME.copy(), np.zeros(robot.nq)
    q[half] = square.posture
    start = robot.fk(q)[arm]
    profile = side_profile(square.speed)
    drifts, speeds, rooms, worths, positions, ends = [0.0], [dq], [], [], [start[:3, 3]], []
    limited = set()
    for side in (*square.sides, *-square.sides):
        for pace in profile:
            twists = np.zeros((2, 3))
            twists[arm] = pace * side
            answer = control.solve(*twists, q, dq, period=PERIOD, max_speed=square.max_speed)
            dq = answer.dq
            q = q + PERIOD * dq
            wrist = robot.fk(q)[arm]
            drifts.append(float(np.degrees(np.linalg.norm(pin.log3(wrist[:3, :3] @ start[:3, :3].T)))))
            positions.append(wrist[:3, 3])
            speeds.append(dq)
            worths.append(answer.manipulability[arm])
            rooms.append(float(np.minimum(robot.upper - q, q - robot.lower)[half].min()))
            limited.add(answer.limited_by[arm])
        ends.append(positions[-1])
    way, moved = np.array(positions) - start[:3, 3], np.array(speeds)[:, half]
    corners = SIDE * np.array([square.sides[0], square.sides.sum(axis=0), square.sides[1], np.zeros(3)])
    return Round(
        path_error=max(_distance(point, corners) for point in way),
        corner_error=float(np.linalg.norm(np.array(ends) - start[:3, 3] - corners, axis=1).max()),
        drift=max(drifts),
        speed=float(np.abs(moved).max()),
        acceleration=float(np.abs(np.diff(moved, axis=0)).max() / PERIOD),
        room=min(rooms),
        manipulability=float(min(worths)),
        limited=sorted(limited - {""}),
        path=way @ square.sides.T,
    )


def side_profile(speed: float) -> np.ndarray:
    """Speeds that are asked for on a side, tick by tick; together they amount to `SIDE` [m/s]."""
    count = round((SIDE / speed + RAMP) / PERIOD)
    middles = PERIOD * (np.arange(count) + 0.5)
    shape = np.minimum(1.0, np.minimum(middles, middles[::-1]) / RAMP)
    return np.concatenate((SIDE / (PERIOD * shape.sum()) * shape, np.zeros(round(PAUSE / PERIOD))))


def _distance(point: np.ndarray, corners: np.ndarray) -> float:
    """From a point to the outline [m]."""
    begins = np.roll(corners, 1, axis=0)
    sides = (corners - begins) / SIDE
    along = np.clip(((point - begins) * sides).sum(axis=1), 0.0, SIDE)
    return float(np.linalg.norm(point - begins - along[:, None] * sides, axis=1).min())
