"""Courses that lead an arm into trouble and back: each a start, a command over time, and what surrounds it.

Every course is there for the left and for the right arm.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pinocchio as pin

from ik_service.robot import Robot

HOME = np.array([0.0, 0.3, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0, -0.3, 0.0, 0.3, 0.0, 0.0, 0.0])
SPEED = 0.2
"""Speed of the hand that is asked for [m/s]."""

ANYWHERE = "anywhere"
"""Kind of the courses that begin in random postures."""

MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""A twist of a hand to that of the other one that mirrors it."""

MIRROR_JOINTS = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Joints of an arm to those of the other one that mirrors it."""


@dataclass(frozen=True)
class Course:
    """One sweep of an arm: there, and back.

    Attributes:
        kind: What it leads into.
        name: Its name.
        start: Joint positions at the start [rad].
        twist: What is asked of the hand on the way there [m/s, rad/s]; on the way back, its opposite.
        there: Time until the command turns about [s].
        back: Time after that [s].
        mirrored: Whether the other hand mirrors it; else it stands still.
        options: Options of the controller.
        arm: 0 for the left arm, 1 for the right.
    """

    kind: str
    name: str
    start: np.ndarray
    twist: np.ndarray
    there: float = 3.0
    back: float = 2.0
    mirrored: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    arm: int = 0


def courses(robot: Robot, random: int) -> Iterator[Course]:
    """All courses.

    Args:
        robot: The G1.
        random: How many random ones.
    """
    for course in (*_straight_elbow(), *_over_the_shoulder(), *_box(robot), *_into_the_body()):
        yield course
        yield _of_the_right_arm(course)
    for arm in (0, 1):
        yield from _joint_limits(robot, arm)
    yield from _anywhere(robot, random)


def _of_the_right_arm(course: Course) -> Course:
    """A course of the left arm, mirrored."""
    left, right = np.split(course.start, 2)
    options = dict(course.options)
    if (box := options.pop("left_bounds", None)) is not None:
        options["right_bounds"] = np.sort(box * MIRROR[:3], axis=0)
    start = np.concatenate((right * MIRROR_JOINTS, left * MIRROR_JOINTS))
    return replace(course, arm=1, start=start, twist=course.twist * MIRROR, options=options)


def _straight_elbow() -> Iterator[Course]:
    for name, way in (("forward", (1, 0, 0.3)), ("down", (0.1, 0, -1)), ("outward", (0.3, 1, 0)), ("up", (0.5, 0, 1))):
        yield Course("straight elbow", name, HOME, _linear(way), options={"collision": "off"})


def _over_the_shoulder() -> Iterator[Course]:
    """The hand passes the axis of the first joint, sideways of the shoulder, at several heights."""
    for roll in (0.9, 1.2, 1.5):
        start = HOME.copy()
        start[:7] = [0.4, roll, 0.2, 0.4, 0.0, 0.0, 0.0]
        for name, way in (("backward", (-1, 0, 0)), ("up", (0, 0, 1)), ("outward", (0, 1, 0.2))):
            yield Course("shoulder", f"{name} at {roll}", start, _linear(way), options={"collision": "off"})


def _joint_limits(robot: Robot, arm: int) -> Iterator[Course]:
    """The twist that the joint alone would make of the hand."""
    for joint, name in enumerate(robot.arms[arm].joint_names, start=7 * arm):
        for side, end in (("lower", robot.lower[joint]), ("upper", robot.upper[joint])):
            start = HOME.copy()
            start[joint] = end - 0.4 * np.sign(end)
            step = np.zeros(robot.nq)
            step[joint] = 1e-6 * np.sign(end)
            here, there = robot.fk(start)[arm], robot.fk(start + step)[arm]
            turn = pin.log3(there[:3, :3] @ here[:3, :3].T)
            twist = 0.5e6 * np.array([*(there - here)[:3, 3], *turn])
            yield Course("joint limit", f"{name} {side}", start, twist, options={"collision": "off"}, arm=arm)


def _box(robot: Robot) -> Iterator[Course]:
    p = robot.fk(HOME)[0][:3, 3]
    options = {"left_bounds": np.array([p - 0.06, p + 0.06]), "collision": "off"}
    for axis, letter in enumerate("xyz"):
        for sign, word in ((-1.0, "-"), (1.0, "+")):
            way = np.zeros(3)
            way[axis] = sign
            way[(axis + 1) % 3] = 0.2
            yield Course("box", f"{word}{letter}", HOME, _linear(way), options=options)


def _into_the_body() -> Iterator[Course]:
    for name, way in (("inward", (0, -1, 0)), ("to the belly", (-1, -1, 0)), ("to the chest", (-1, -0.5, 0.5))):
        yield Course("body", name, HOME, _linear(way), mirrored=True)


def _anywhere(robot: Robot, count: int) -> Iterator[Course]:
    rng = np.random.default_rng(7)
    for k in range(count):
        start = rng.uniform(0.95 * robot.lower, 0.95 * robot.upper)
        yield Course(ANYWHERE, str(k), start, _linear(rng.normal(size=3)), options={"collision": "off"}, arm=k % 2)


def _linear(way: Any) -> np.ndarray:
    direction = np.asarray(way, dtype=float)
    return np.array([*(SPEED * direction / np.linalg.norm(direction)), 0.0, 0.0, 0.0])
