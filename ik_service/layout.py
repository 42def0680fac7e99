"""What the kernel's functions are told and what they say: the layout of their vectors.

A request is q and the two targets row by row. Options are everything else: waist, what is particular to each arm, what
both share, and what to do about collisions. An answer is q and torques, and a report says what they are worth.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from ik_service.arm import ARM_OPTIONS, SHARED_OPTIONS, Arm
from ik_service.collision import Carrier
from ik_service.kinematics import waist_motion
from ik_service.robot import Robot

OFF, REPORT_ONLY, AVOID = 0.0, 1.0, 2.0
"""Values of the option `collision`."""

REPORT = (
    "value_left",
    "value_right",
    "position_left",
    "position_right",
    "rotation_left",
    "rotation_right",
    "settled_left",
    "settled_right",
    "iterations",
    "clearance",
    "nearest",
    "diverted",
)
"""What a solve says of its answer: cost, position error [m], rotation error [rad] and whether the descent settled, each
left and right; iterations of both; clearance [m] and the place of the nearest pair; whether the body was in the way."""


@dataclass(frozen=True)
class JointCounts:
    """What the layout of any vectors of a robot follows from.

    Attributes:
        nq: Arm joints, both arms.
        waist: Waist joints.
    """

    nq: int
    waist: int

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """Lay out the vectors of a robot."""
        return cls(robot.nq, len(robot.waist.joint_names))


class Layout(JointCounts):
    """Where things are in the vectors of a robot's kernel."""

    @property
    def request(self) -> int:
        """Length of the request: q, then the two targets row by row."""
        return self.nq + 32

    @property
    def option_cuts(self) -> list[int]:
        """Where the options' parts begin and end: waist, arm options left and right, shared options, collision."""
        sizes = [0, self.waist, len(ARM_OPTIONS), len(ARM_OPTIONS), len(SHARED_OPTIONS), 1]
        return np.cumsum(sizes).tolist()

    @property
    def options(self) -> int:
        """Length of the options."""
        return self.option_cuts[-1]

    @property
    def answer(self) -> int:
        """Length of the answer: q, then torques."""
        return 2 * self.nq


@dataclass(frozen=True)
class Inputs:
    """The symbols of a request and its options, taken apart.

    Attributes:
        request: The request's vector.
        options: The options' vector.
        q: Joint positions of the request [rad].
        problems: Problem of each arm.
        retreat: Option `retreat`.
        collision: Option `collision`.
        base_ends: Ends of the base's capsules as the arms see them [m], shape (3, 2 count).
        torque: q -> torques that hold the arms [N m].
    """

    request: ca.MX
    options: ca.MX
    q: ca.MX
    problems: list[ca.MX]
    retreat: ca.MX
    collision: ca.MX
    base_ends: ca.MX
    torque: Callable[[ca.MX], ca.MX]

    @classmethod
    def of(cls, robot: Robot, arms: Sequence[Arm]) -> "Inputs":
        """Take the inputs of a robot's kernel apart."""
        layout, nq, split = Layout.of(robot), robot.nq, arms[0].n
        request, options = ca.MX.sym("request", layout.request), ca.MX.sym("options", layout.options)
        q, T_left, T_right = ca.vertsplit(request, [0, nq, nq + 16, nq + 32])
        waist, left_options, right_options, shared, collision = ca.vertsplit(options, layout.option_cuts)
        R, p, base_ends, gravity = mount(robot)(waist)
        per_arm = zip(arms, (q[:split], q[split:]), (T_left, T_right), (left_options, right_options), strict=True)
        problems = [arm.problem(part, T, own, shared, R, p) for arm, part, T, own in per_arm]

        def torque(q: ca.MX) -> ca.MX:
            halves = zip(arms, (q[:split], q[split:]), strict=True)
            return ca.vertcat(*(arm.torque(part, gravity) for arm, part in halves))

        retreat = shared[SHARED_OPTIONS.index("retreat")]
        return cls(request, options, q, problems, retreat, collision, base_ends, torque)


def split_report(report: ca.MX) -> list[ca.MX]:
    """Take an arm's report apart: cost, position error [m], rotation error [rad], iterations, settled."""
    return ca.vertsplit(report)


def report_of(reports: list[ca.MX], state: list[ca.MX]) -> ca.MX:
    """Put the reports of both arms and (clearance, nearest pair, diverted) into the order of `REPORT`."""
    (value_l, position_l, rotation_l, iterations_l, settled_l), right = map(split_report, reports)
    value_r, position_r, rotation_r, iterations_r, settled_r = right
    pairs = (value_l, value_r, position_l, position_r, rotation_l, rotation_r, settled_l, settled_r)
    return ca.vertcat(*pairs, iterations_l + iterations_r, *state)


def mount(robot: Robot) -> ca.Function:
    """Waist joints -> (R, p, ends of the base's capsules, gravity), the last two as the arms see them."""
    waist = ca.SX.sym("waist", len(robot.waist.joint_names))
    R, p = waist_motion(robot.waist, waist)
    base = [capsule for capsule in robot.collision.capsules if capsule.carrier is Carrier.BASE]
    ends = ca.SX(np.array([end for capsule in base for end in (capsule.start, capsule.end)]).reshape(-1, 3).T)
    seen = R.T @ (ends - ca.repmat(p, 1, ends.shape[1])) if base else ca.SX.zeros(3, 0)
    return ca.Function("mount", [waist], [R, p, seen, R.T @ ca.SX(robot.arms[0].gravity)], {"cse": True})
