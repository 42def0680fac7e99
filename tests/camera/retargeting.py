"""Takes arms of people to the robot, as the loop does it, without camera or wire.

Wrist basis, way out of the body, scaling, inverse kinematics, limiter and the check behind it. The check belongs to it:
between two clear answers an arm's momentum takes it into the body, and a solver that begins there opens on whichever
side is nearer.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from skinned_person import Array

from camera_client.clear_arms import ClearArms
from camera_client.estimate import ORIENTATION_FLOOR
from camera_client.scaling import G1_ARMS, elbow_hints, wrist_positions
from camera_client.wrist_basis import WristBasis, flexion_weight
from ik_client.clear_way import ClearWay
from ik_client.joint_limiter import JointLimiter
from ik_proto.robots import RobotDescription
from ik_service.gauge import Gauge
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
        clearance: Of the command, shape (n,) [m].
        elbow_off: Angle between the upper arms of person and answer, shape (n, 2) [degree].
        wrist_off: Of the answer from its target, shape (n, 2) [m].
        turn_off: The same of its orientation, shape (n, 2) [rad].
        possible: Whether some posture within limits and clear of the body, looked for from many starts, has the wrist
            where the person's is, not where it is moved to, and the upper arm like the person's, shape (n, 2).
        velocity: Of the command, shape (n, nq) [rad/s].
        acceleration: Of the command, shape (n, nq) [rad/s^2].
    """

    wanted: Array
    commanded: Array
    clearance: Array
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
        self._gauge = Gauge(robot, solver.kernel)
        self._clear = ClearArms(G1_ARMS, description)
        self._model = pin.buildModelFromMJCF(str(description.model))
        self._data = self._model.createData()
        self._base = self._model.getFrameId(description.base)

    def replay(self, limbs: Array, *, kept_clear: bool = True) -> Replay:
        """Do a clip.

        Args:
            limbs: Unit directions of upper arms and forearms at `RATE`, pelvis frame, shape (n, 2, 2, 3).
            kept_clear: Whether forearms are kept out of the body.
        """
        robot, basis = self._robot, WristBasis()
        limiter = JointLimiter(robot.nq, 1.0 / RATE, lower=robot.lower, upper=robot.upper)
        way = ClearWay(limiter, lambda q, _: self._gauge.clearance(q)[0])
        command = np.zeros(robot.nq)
        rows = []
        for now in limbs:
            R = basis.update(now[:, 0], now[:, 1], 1.0 / RATE, np.ones(2))
            turned = ORIENTATION_FLOOR + (1.0 - ORIENTATION_FLOOR) * flexion_weight(now[:, 0], now[:, 1])
            weights = np.stack([np.ones(2), turned], axis=1)
            asked = self._clear(now, R) if kept_clear else (now, R)
            answer = self._solver.solve(q=command, weights=weights, **_request(*asked))
            any_answer = self._solver.solve(q=command, weights=weights, mode="reach", **_request(now, R))
            command = way.step(command, answer.q, 1.0 / RATE, None)
            clearance = self._gauge.clearance(command[None])[0][0]
            off, any_off = self._elbow_off(answer.q, now), self._elbow_off(any_answer.q, now)
            there = (any_answer.position_error < REACHED[0]) & (any_answer.rotation_error < REACHED[1])
            possible = there & (any_off < ELBOW_LIKE)
            motion = limiter.velocity, limiter.acceleration
            errors = answer.position_error, answer.rotation_error
            rows.append((answer.q, command, clearance, off, *errors, possible, *motion))
        return Replay(*(np.array(column) for column in zip(*rows, strict=True)))

    def _elbow_off(self, q: Array, limbs: Array) -> Array:
        """Angle between upper arms of robot and person, shape (2,) [degree]."""
        upper = self._upper_arms(q)
        cosine = (upper * limbs[:, 0]).sum(axis=1) / np.linalg.norm(upper, axis=1)
        return np.degrees(np.arccos(cosine.clip(-1.0, 1.0)))

    def _upper_arms(self, q: Array) -> Array:
        """From the second joint of each arm to its elbow, base frame, shape (2, 3) [m], by Pinocchio."""
        configuration = np.zeros(self._model.nq)
        for name, angle in zip(self._robot.joint_names, q, strict=True):
            configuration[self._model.joints[self._model.getJointId(name)].idx_q] = angle
        pin.framesForwardKinematics(self._model, self._data, configuration)
        base = self._data.oMf[self._base]
        ends = [
            [base.actInv(self._data.oMi[self._model.getJointId(arm.joint_names[k])]).translation for k in (1, 3)]
            for arm in self._robot.arms
        ]
        return np.diff(np.array(ends), axis=1)[:, 0]


def _request(limbs: Array, R_pelvis_wrist: Array) -> dict[str, Any]:
    """Where the solver is asked to take both arms."""
    T = np.tile(np.eye(4), (2, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = R_pelvis_wrist, wrist_positions(limbs, G1_ARMS)
    hints = elbow_hints(limbs, np.ones(2), G1_ARMS)
    wrists = {"left_wrist": T[0], "right_wrist": T[1]}
    return {**wrists, "left_elbow": hints[0], "right_elbow": hints[1]}
