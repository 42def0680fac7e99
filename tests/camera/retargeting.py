"""Takes arms of people to the robot, as the loop does it, without camera or wire.

Wrist basis, straight arms, way out of the body, scaling, inverse kinematics, limiter and the check behind it. The check
belongs to it: between two clear answers an arm's momentum takes it into the body, and a solver that begins there opens
on whichever side is nearer.

What is possible is judged by itself, whatever the robot does, so that two ways of following are judged by the same
frames. Where a possible upper arm is missed, experiments with that one request say why (`missed`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from missed import Missed
from numpy.typing import NDArray
from skinned_person import Array

from camera_client.clear_arms import ClearArms
from camera_client.estimate import ORIENTATION_FLOOR
from camera_client.robot_arms import robot_geometry
from camera_client.scaling import elbow_hints, wrist_positions
from camera_client.straight_arms import straightened
from camera_client.wrist_basis import WristBasis, flexion_weight
from ik_client.clear_way import KEPT, ClearWay
from ik_client.joint_limiter import JointLimiter
from ik_proto import Status
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
SAMPLES = 9
"""Postures that are looked at between a command and the last answer."""

Start = Literal["command", "answer", "unlimited"]
"""Where an answer begins: from the last command, as the loop has it; from the last answer, where the straight way to it
from the command is clear; or from a command that is the answer, of a robot without limits of speed."""


@dataclass(frozen=True)
class Replay:
    """A clip as the robot did it.

    Attributes:
        wanted: Joints as solved, shape (n, nq) [rad].
        commanded: Joints as limited, shape (n, nq) [rad].
        clearance: Of the command, shape (n,) [m].
        elbow_off: Angle between the upper arms of person and answer, shape (n, 2) [degree].
        robot_off: Angle between the upper arms of person and command, shape (n, 2) [degree].
        wrist_off: Of the answer from its target, shape (n, 2) [m].
        turn_off: The same of its orientation, shape (n, 2) [rad].
        possible: As in `Possible`, shape (n, 2).
        velocity: Of the command, shape (n, nq) [rad/s].
        acceleration: Of the command, shape (n, nq) [rad/s^2].
        blocked: Whether the body kept the answer from its targets, shape (n,).
        causes: Why an upper arm that is possible is not like the person's, None where it is, shape (n, 2).
    """

    wanted: Array
    commanded: Array
    clearance: Array
    elbow_off: Array
    robot_off: Array
    wrist_off: Array
    turn_off: Array
    possible: NDArray[np.bool_]
    velocity: Array
    acceleration: Array
    blocked: NDArray[np.bool_]
    causes: NDArray[np.object_]

    def judged(self) -> NDArray[np.bool_]:
        """What is possible, but for the first second: the robot begins with its arms elsewhere."""
        possible = self.possible.copy()
        possible[: round(RATE)] = False
        return possible


@dataclass(frozen=True)
class Possible:
    """What of a clip a robot could do that had time.

    Attributes:
        arms: Whether some posture within limits and clear of the body, looked for from many starts, has the wrist where
            the person's is, not where it is moved to, and the upper arm like the person's, shape (n, 2).
        q: Such a posture, its arm's part NaN where there is none, shape (n, nq) [rad].
    """

    arms: NDArray[np.bool_]
    q: Array


class Retargeting:
    """A robot that takes limb directions."""

    def __init__(self, robot: Robot, solver: Solver, description: RobotDescription, waist: Array | None = None) -> None:
        """Take what solves.

        Args:
            robot: The robot.
            solver: Solves for it.
            description: Describes it; its model says where elbows are.
            waist: Positions of its waist's joints [rad]; None for a straight one. People bend theirs likewise.
        """
        self._robot, self._solver = robot, solver
        self._gauge = Gauge(robot, solver.kernel)
        geometry = robot_geometry(description)
        self._clear, self._arms, self._waist = ClearArms(geometry.arms, description), geometry.bent(waist), waist
        self._waist_names = description.waist
        self._model = pin.buildModelFromMJCF(str(description.model))
        self._data = self._model.createData()
        self._base = self._model.getFrameId(description.base)

    def replay(
        self,
        limbs: Array,
        *,
        kept_clear: bool = True,
        knows_waist: bool = True,
        start: Start = "command",
        possible: Possible | None = None,
    ) -> Replay:
        """Do a clip.

        Args:
            limbs: Unit directions of upper arms and forearms at `RATE`, pelvis frame, shape (n, 2, 2, 3).
            kept_clear: Whether forearms are kept out of the body.
            knows_waist: Whether they are kept out of where a bent waist takes it.
            start: Where answers begin.
            possible: What `possible` says of the clip; None asks it.
        """
        robot, possible = self._robot, possible or self.possible(limbs)
        limiter = JointLimiter(robot.nq, 1.0 / RATE, lower=robot.lower, upper=robot.upper)
        way = ClearWay(limiter, lambda q, _: self._clearance(q))
        bent = self._arms if knows_waist else None
        command = last = np.zeros(robot.nq)
        rows = []
        for k, (now, R, weights) in enumerate(self._asked(limbs)):
            asked = straightened(now, R, self._arms.upper, self._arms.fore)
            asked = self._clear(*asked, bent) if kept_clear else asked
            q = last if start == "answer" and self._clear_between(command, last) else command
            answer = self._solver.solve(q=q, weights=weights, **self._request(*asked))
            off = self._elbow_off(answer.q, now)
            causes = [None, None]
            for side in np.flatnonzero(possible.arms[k] & (off > ELBOW_LIKE)):
                missed = Missed(self._solver, weights, lambda q, side=side, now=now: self._like(q, now, side))
                ideal = np.where(_joints(side, robot.nq), possible.q[k], q)
                causes[side] = missed.cause(q, ideal, self._request(now, R), self._request(*asked))
            last = answer.q
            command = last.copy() if start == "unlimited" else way.step(command, last, 1.0 / RATE, None)
            clearance = self._clearance(command[None])[0]
            motion = limiter.velocity, limiter.acceleration
            errors = answer.position_error, answer.rotation_error
            done = self._elbow_off(command, now)
            blocked = answer.status is Status.BLOCKED
            rows.append((last, command, clearance, off, done, *errors, possible.arms[k], *motion, blocked, causes))
        return Replay(*(np.array(column) for column in zip(*rows, strict=True)))

    def possible(self, limbs: Array) -> Possible:
        """Judge what of a clip is possible; as in `replay`. Looked for from where it was found last, and from afar."""
        nq = self._robot.nq
        found, arms, q = np.zeros(nq), np.zeros((len(limbs), 2), dtype=bool), np.full((len(limbs), nq), np.nan)
        for k, (now, R, weights) in enumerate(self._asked(limbs)):
            for begin in (found, np.zeros(nq)):
                answer = self._solver.solve(q=begin, weights=weights, mode="reach", **self._request(now, R))
                there = (answer.position_error < REACHED[0]) & (answer.rotation_error < REACHED[1])
                there &= self._elbow_off(answer.q, now) < ELBOW_LIKE
                for side in np.flatnonzero(there & ~arms[k]):
                    arms[k, side] = True
                    q[k] = np.where(_joints(side, nq), answer.q, q[k])
                if arms[k].all():
                    break
            found = np.where(np.isfinite(q[k]), q[k], found)
        return Possible(arms, q)

    def upper_arms(self, q: Array) -> Array:
        """Unit directions of both upper arms, base frame, shape (2, 3)."""
        upper = self._upper_arms(q)
        return upper / np.linalg.norm(upper, axis=1, keepdims=True)

    def _like(self, q: Array, limbs: Array, side: int) -> bool:
        return bool(self._elbow_off(q, limbs)[side] <= ELBOW_LIKE)

    def _clear_between(self, q: Array, q_end: Array) -> bool:
        """Whether the straight way between two postures is as clear as commands are kept."""
        way = q + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (q_end - q)
        return bool(self._clearance(way).min() >= KEPT)

    def _elbow_off(self, q: Array, limbs: Array) -> Array:
        """Angle between upper arms of robot and person, shape (2,) [degree]."""
        cosine = (self.upper_arms(q) * limbs[:, 0]).sum(axis=1)
        return np.degrees(np.arccos(cosine.clip(-1.0, 1.0)))

    def _upper_arms(self, q: Array) -> Array:
        """From the second joint of each arm to its elbow, base frame, shape (2, 3) [m], by Pinocchio."""
        configuration = np.zeros(self._model.nq)
        waist = np.zeros(len(self._waist_names)) if self._waist is None else self._waist
        for name, angle in zip((*self._robot.joint_names, *self._waist_names), (*q, *waist), strict=True):
            configuration[self._model.joints[self._model.getJointId(name)].idx_q] = angle
        pin.framesForwardKinematics(self._model, self._data, configuration)
        base = self._data.oMf[self._base]
        ends = [
            [base.actInv(self._data.oMi[self._model.getJointId(arm.joint_names[k])]).translation for k in (1, 3)]
            for arm in self._robot.arms
        ]
        return np.diff(np.array(ends), axis=1)[:, 0]

    def _clearance(self, q: Array) -> Array:
        """Smallest distance between two parts of the body, of postures of shape (k, nq), shape (k,) [m]."""
        return self._gauge.clearance(q, self._waist)[0]

    def _asked(self, limbs: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Limbs with the waist as it is, orientations of the wrists and weights of the targets, of each tick."""
        basis = WristBasis()
        for straight in limbs:
            now = straight @ self._arms.R_waist.T
            R = basis.update(now[:, 0], now[:, 1], 1.0 / RATE, np.ones(2))
            turned = ORIENTATION_FLOOR + (1.0 - ORIENTATION_FLOOR) * flexion_weight(now[:, 0], now[:, 1])
            yield now, R, np.stack([np.ones(2), turned], axis=1)

    def _request(self, limbs: Array, R_pelvis_wrist: Array) -> dict[str, Any]:
        """What the solver is asked of both arms."""
        T = np.tile(np.eye(4), (2, 1, 1))
        T[:, :3, :3], T[:, :3, 3] = R_pelvis_wrist, wrist_positions(limbs, self._arms)
        left, right = elbow_hints(limbs, np.ones(2), self._arms)
        wrists = {"left_wrist": T[0], "right_wrist": T[1]}
        return {**wrists, "left_elbow": left, "right_elbow": right, "waist": self._waist}


def _joints(side: int, nq: int) -> NDArray[np.bool_]:
    """Which joints are those of an arm."""
    return np.arange(nq) // (nq // 2) == side
