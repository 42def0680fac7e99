"""Takes arms of people to the robot: wrist basis, scaling, inverse kinematics and limiter, without camera or wire."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from skinned_person import Array

from camera_client.estimate import ORIENTATION_FLOOR
from camera_client.scaling import G1_ARMS, elbow_hints, wrist_positions
from camera_client.wrist_basis import WristBasis, flexion_weight
from ik_client.joint_limiter import JointLimiter
from ik_proto.robots import RobotDescription
from ik_service.robot import Robot
from ik_service.solver import Solver

RATE = 50.0
"""Commands a second."""
REACHED = 0.01, np.radians(10.0)
"""A wrist this near its target, and this little turned, is where it was wanted [m, rad]."""
ELBOW_LIKE = 12.0
"""An upper arm this near the person's is like it [degree]."""


@dataclass(frozen=True)
class Replay:
    """A clip as the robot did it.

    Attributes:
        wanted: Joints as solved, shape (n, nq) [rad].
        commanded: Joints as limited, shape (n, nq) [rad].
        elbow_off: Angle between the upper arms of person and answer, shape (n, 2) [degree].
        wrist_off: Of the answer from its target, shape (n, 2) [m].
        turn_off: The same of its orientation, shape (n, 2) [rad].
        possible: Whether some posture within limits and clear of the body, looked for from many starts, has the wrist
            where it is wanted and the upper arm like the person's, shape (n, 2).
        velocity: Of the command, shape (n, nq) [rad/s].
        acceleration: Of the command, shape (n, nq) [rad/s^2].
    """

    wanted: Array
    commanded: Array
    elbow_off: Array
    wrist_off: Array
    turn_off: Array
    possible: NDArray[np.bool_]
    velocity: Array
    acceleration: Array


class Retargeting:
    """A robot that takes limb directions."""

    def __init__(self, robot: Robot, solver: Solver, description: RobotDescription) -> None:
        """Take what solves.

        Args:
            robot: The robot.
            solver: Solves for it.
            description: Describes it; its model says where elbows are.
        """
        self._robot, self._solver = robot, solver
        self._model = pin.buildModelFromMJCF(str(description.model))
        self._data = self._model.createData()
        self._base = self._model.getFrameId(description.base)

    def replay(self, limbs: Array) -> Replay:
        """Do a clip.

        Args:
            limbs: Unit directions of upper arms and forearms at `RATE`, pelvis frame, shape (n, 2, 2, 3).
        """
        robot, basis = self._robot, WristBasis()
        limiter = JointLimiter(robot.nq, 1.0 / RATE, lower=robot.lower, upper=robot.upper)
        command = np.zeros(robot.nq)
        rows = []
        for now in limbs:
            T = np.tile(np.eye(4), (2, 1, 1))
            T[:, :3, :3] = basis.update(now[:, 0], now[:, 1], 1.0 / RATE, np.ones(2))
            T[:, :3, 3] = wrist_positions(now, G1_ARMS)
            hints = elbow_hints(now, np.ones(2), G1_ARMS)
            turned = ORIENTATION_FLOOR + (1.0 - ORIENTATION_FLOOR) * flexion_weight(now[:, 0], now[:, 1])
            weights = np.stack([np.ones(2), turned], axis=1)
            asked: dict[str, Any] = {"left_elbow": hints[0], "right_elbow": hints[1], "weights": weights}
            answer = self._solver.solve(T[0], T[1], command, **asked)
            any_answer = self._solver.solve(T[0], T[1], command, mode="reach", **asked)
            command = limiter.limit(command, answer.q)
            off, any_off = self._elbow_off(answer.q, now), self._elbow_off(any_answer.q, now)
            there = (any_answer.position_error < REACHED[0]) & (any_answer.rotation_error < REACHED[1])
            possible = there & (any_off < ELBOW_LIKE)
            motion = limiter.velocity, limiter.acceleration
            rows.append((answer.q, command, off, answer.position_error, answer.rotation_error, possible, *motion))
        return Replay(*(np.array(column) for column in zip(*rows, strict=True)))

    def _elbow_off(self, q: Array, limbs: Array) -> Array:
        """Angle between upper arms of robot and person, shape (2,) [degree]."""
        upper = self._elbows(q) - G1_ARMS.shoulders
        cosine = (upper * limbs[:, 0]).sum(axis=1) / np.linalg.norm(upper, axis=1)
        return np.degrees(np.arccos(cosine.clip(-1.0, 1.0)))

    def _elbows(self, q: Array) -> Array:
        """Where the elbows are, base frame, shape (2, 3) [m], by Pinocchio."""
        configuration = np.zeros(self._model.nq)
        for name, angle in zip(self._robot.joint_names, q, strict=True):
            configuration[self._model.joints[self._model.getJointId(name)].idx_q] = angle
        pin.framesForwardKinematics(self._model, self._data, configuration)
        base = self._data.oMf[self._base]
        names = [arm.joint_names[3] for arm in self._robot.arms]
        return np.stack([base.actInv(self._data.oMi[self._model.getJointId(name)]).translation for name in names])
