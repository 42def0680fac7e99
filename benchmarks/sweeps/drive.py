"""Drives a course and judges what the arm did."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.sweeps.courses import MIRROR, SPEED, Course
from ik_proto.limits import DEFAULT_ACCELERATION
from ik_service.robot import Robot
from ik_service.velocity import RateController

PERIOD = 0.02
STOPPED = 0.01
"""Speed of a hand that has stopped, or creeps [m/s]: a twentieth of what is asked for."""

SETTLING = 0.4
"""Time after a turn of the command in which the hand is still turning [s]."""

TURNING = 0.99
"""Share of the largest acceleration from which on it is what decides."""

MOVING = 0.02
"""Speed of a joint that moves [rad/s]."""


@dataclass(frozen=True)
class Driven:
    """What the arm did on a course.

    Attributes:
        speed: Fastest joint [rad/s].
        acceleration: Largest change of a joint's speed [rad/s^2].
        turns: Changes of direction of the joint that has most of them, a second.
        deviation: Largest angle between asked and achieved velocity of a hand that moves [degrees], but for the ticks
            in which the largest acceleration turns the arm.
        gone: How far the hand went on the way there [m].
        returned: How far it went on the way back [m].
        room: Smallest distance of a joint to its limits [rad].
        clearance: Smallest clearance [m].
        end: Joint positions at the end [rad].
        trace: Time [s], asked and achieved speed along the command with rotations as at 0.3 m [m/s], manipulability
            [m^3], fastest joint [rad/s].
    """

    speed: float
    acceleration: float
    turns: float
    deviation: float
    gone: float
    returned: float
    room: float
    clearance: float
    end: np.ndarray
    trace: list[list[float]]

    @property
    def manipulability(self) -> float:
        """Manipulability of the start [m^3]."""
        return self.trace[0][3]

    @property
    def left(self) -> bool:
        """Whether the hand could move away again, or never got anywhere."""
        return self.returned > STOPPED or self.gone < STOPPED

    @property
    def stuck(self) -> bool:
        """Whether it went neither there nor back."""
        return max(self.gone, self.returned) < STOPPED


def drive(robot: Robot, control: RateController, course: Course) -> Driven:
    """Follow the answers from rest.

    Args:
        robot: The robot.
        control: Answers.
        course: What is asked for.

    Returns:
        What the arm did.
    """
    q, dq, arm = course.start.copy(), np.zeros(robot.nq), course.arm
    half = slice(7 * arm, 7 * arm + 7)
    velocities, trace, deviations, clearances, rooms = [np.zeros(7)], [], [0.0], [], []
    gone = returned = 0.0
    for k in range(round((course.there + course.back) / PERIOD)):
        t = k * PERIOD
        going = t < course.there
        twist = course.twist if going else -course.twist
        twists = [twist * MIRROR if course.mirrored else np.zeros(6)] * 2
        twists[arm] = twist
        answer = control.solve(*twists, q, dq, period=PERIOD, **course.options)
        achieved, asked = answer.twists[arm], float(np.linalg.norm(twist[:3]))
        along = float(_scaled(achieved) @ _scaled(twist) / np.linalg.norm(_scaled(twist)))
        settled = t - (0.0 if going else course.there) >= SETTLING
        turning = float(np.abs(answer.dq - dq)[half].max()) > TURNING * DEFAULT_ACCELERATION * PERIOD
        if settled and not turning and np.linalg.norm(achieved[:3]) > STOPPED and asked > STOPPED:
            deviations.append(_angle(achieved[:3], twist[:3]))
        if going:
            gone += PERIOD * along
        else:
            returned += PERIOD * along
        dq = answer.dq
        velocities.append(dq[half].copy())
        q = q + PERIOD * dq
        rooms.append(float(np.minimum(robot.upper - q, q - robot.lower)[half].min()))
        clearances.append(answer.clearance)
        sign, pace = 1.0 if going else -1.0, float(np.linalg.norm(_scaled(twist)))
        fastest = float(np.abs(dq[half]).max())
        trace.append([t, sign * pace, sign * along, float(answer.manipulability[arm]), fastest])
    moved = np.array(velocities)
    return Driven(
        speed=float(np.abs(moved).max()),
        acceleration=float(np.abs(np.diff(moved, axis=0)).max() / PERIOD),
        turns=max(_turns(column) for column in moved.T) / (course.there + course.back),
        deviation=max(deviations),
        gone=gone,
        returned=returned,
        room=min(rooms),
        clearance=min(clearances),
        end=q,
        trace=trace,
    )


def ways_out(robot: Robot, control: RateController, q: np.ndarray, arm: int, held: bool) -> int:
    """In how many of 26 directions a hand gets away from a posture, by more than `STOPPED` in two seconds [m].

    Args:
        robot: The robot.
        control: Answers.
        q: The posture [rad].
        arm: 0 for the left arm, 1 for the right.
        held: Whether the orientation is held.
    """
    begin, count = robot.fk(q)[arm][:3, 3], 0
    for place in np.ndindex(3, 3, 3):
        way = np.array(place) - 1.0
        if not way.any():
            continue
        twists, now, dq = np.zeros((2, 3)), q.copy(), np.zeros(robot.nq)
        twists[arm] = SPEED * way / np.linalg.norm(way)
        for _ in range(round(2.0 / PERIOD)):
            dq = control.solve(*twists, now, dq, period=PERIOD, collision="off", hold=(held, held)).dq
            now = now + PERIOD * dq
        count += bool(np.linalg.norm(robot.fk(now)[arm][:3, 3] - begin) > STOPPED)
    return count


def _turns(speeds: np.ndarray) -> int:
    signs = np.sign(speeds[np.abs(speeds) > MOVING])
    return int((np.diff(signs) != 0.0).sum())


def _scaled(twist: np.ndarray) -> np.ndarray:
    """With rotations as the motion of a point 0.3 m away."""
    return twist * np.array([1.0, 1.0, 1.0, 0.3, 0.3, 0.3])


def _angle(a: Any, b: Any) -> float:
    cosine = a @ b / (np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
