"""How near a robot's capsules are at given joints, as CasADi functions made once and shared."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ik_service.chains import ArmChain
from ik_service.clearance import capsule_ends, clearances, joint_lines, smallest
from ik_service.collision import Carrier, CollisionModel
from ik_service.kinematics import wrist_pose
from ik_service.robot import Robot


@dataclass(frozen=True)
class Proximity:
    """Functions of the joints of both arms and the ends of the base's capsules in the mount frame, shape (3, 2 count).

    Attributes:
        model: Capsules and pairs.
        shape: (q, base ends) -> (ends of all capsules (3, 2 capsules) [m], joint lines (6, nq)).
        clearances: ends of all capsules -> clearance of every pair [m], shape (pairs,).
        distances: (q, base ends) -> clearance of every pair.
        nearest: clearance of every pair -> (the smallest, its place).
        clear: (d, d at the start) -> (whether every pair keeps the margin or what it started with, whether every pair
            keeps half of that).
    """

    model: CollisionModel
    shape: ca.Function
    clearances: ca.Function
    distances: ca.Function
    nearest: ca.Function
    clear: ca.Function

    @classmethod
    def of(cls, robot: Robot) -> "Proximity":
        """Build the functions of a robot that has pairs to check."""
        model, shape = robot.collision, _shape(robot)
        measure = clearances(model)
        q, base_ends = (ca.MX.sym(key, shape.sparsity_in(i)) for i, key in enumerate(("q", "base_ends")))
        d = ca.SX.sym("d", len(model.pairs))
        return cls(
            model=model,
            shape=shape,
            clearances=measure,
            distances=ca.Function("distances", [q, base_ends], [measure(shape(q, base_ends)[0])]),
            nearest=ca.Function("nearest_pair", [d], list(smallest(d))),
            clear=_clear(model),
        )

    @property
    def pairs(self) -> int:
        """Number of checked pairs."""
        return len(self.model.pairs)

    def moves(self, pair: int, arms: Sequence[ArmChain]) -> np.ndarray:
        """How each joint counts in the gradient of a pair: 1 moves the first capsule, -1 the second, 0 both or none."""
        a, b = (self.model.capsules[place] for place in self.model.pairs[pair])
        return np.array(
            [
                (a.carrier is carrier and i <= a.joint) - float(b.carrier is carrier and i <= b.joint)
                for carrier, arm in zip((Carrier.LEFT, Carrier.RIGHT), arms, strict=True)
                for i in range(arm.n)
            ]
        )


def _shape(robot: Robot) -> ca.Function:
    model, split = robot.collision, robot.arms[0].n
    count = sum(capsule.carrier is Carrier.BASE for capsule in model.capsules)
    q, base_ends = ca.SX.sym("q", robot.nq), ca.SX.sym("base_ends", 3, 2 * count)
    left, right = (wrist_pose(arm, part) for arm, part in zip(robot.arms, (q[:split], q[split:]), strict=True))
    segments = capsule_ends(model, left, right, base_ends)
    ends = ca.horzcat(*(column for segment in segments for column in (segment.start, segment.start + segment.along)))
    lines = ca.horzcat(joint_lines(left), joint_lines(right))
    return ca.Function("shape", [q, base_ends], [ends, lines], {"cse": True})


def _clear(model: CollisionModel) -> ca.Function:
    d, d_start = ca.SX.sym("d", len(model.pairs)), ca.SX.sym("d_start", len(model.pairs))
    clear, free = ca.SX(1), ca.SX(1)
    for k in range(len(model.pairs)):
        clear = ca.logic_and(clear, d[k] >= ca.fmin(model.margin, d_start[k]))
        free = ca.logic_and(free, d[k] >= ca.fmin(0.5 * model.margin, d_start[k]))
    return ca.Function("clear", [d, d_start], [clear, free])
