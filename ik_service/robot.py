"""The robot as the solver sees it: two serial arms on a base, every other joint locked at zero.

Pinocchio reads the model file (URDF or MJCF) and stays the authority: forward kinematics and gravity torques come
from it, and the symbolic kinematics of the solver are built from the placements it reports. Vectors of joint values
are in the order of the wire: left arm then right arm, as the description lists them.
"""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin

from ik_proto.robots import ArmDescription, RobotDescription, RobotError

_REACH_STARTS, _REACH_SWEEPS = 4, 5
"""Starts and sweeps of the climb to the farthest posture; on the G1 every start ends within 0.1 mm of the
farthest."""


@dataclass(frozen=True)
class ArmChain:
    """One arm: revolute joints in series from the base to a wrist frame.

    Attributes:
        side: "left" or "right".
        joint_names: Joints from shoulder to wrist, n of them.
        placements: Pose of each joint at zero angle in the frame of the one before it, the first in the base frame; n
            arrays of shape (4, 4).
        axes: Unit rotation axis of each joint in its own frame, n arrays of shape (3,).
        T_last_wrist: Wrist frame in the last joint's frame, shape (4, 4).
        lower: Lower joint limits [rad], shape (n,).
        upper: Upper joint limits [rad], shape (n,).
        masses: Mass of the body each joint moves, with all that is fixed to it, n of them [kg].
        centers: Centre of mass of that body in its joint's frame [m], n arrays of shape (3,).
        gravity: Acceleration of gravity in the base frame [m/s^2], shape (3,).
    """

    side: str
    joint_names: tuple[str, ...]
    placements: tuple[np.ndarray, ...]
    axes: tuple[np.ndarray, ...]
    T_last_wrist: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    masses: tuple[float, ...]
    centers: tuple[np.ndarray, ...]
    gravity: np.ndarray

    @property
    def shoulder(self) -> np.ndarray:
        """Origin of the first joint in the base frame [m], shape (3,)."""
        return self.placements[0][:3, 3]

    def wrist(self, q: np.ndarray) -> np.ndarray:
        """Forward kinematics of this arm alone.

        Args:
            q: Joint positions [rad], shape (n,).

        Returns:
            `T_base_wrist`, shape (4, 4).
        """
        T = np.eye(4)
        for placement, axis, angle in zip(self.placements, self.axes, q, strict=True):
            T = T @ placement
            T[:3, :3] = T[:3, :3] @ pin.exp3(angle * axis)
        return T @ self.T_last_wrist

    @cached_property
    def reach(self) -> float:
        """Largest distance from the shoulder to the wrist frame [m].

        In one joint alone the squared distance is a + b cos q + c sin q, whose largest value within the limits is known
        exactly. Setting joint after joint to its best climbs to a maximum within a few sweeps; the highest from a
        handful of fixed starts is taken.
        """
        starts = np.random.default_rng(0).uniform(self.lower, self.upper, (_REACH_STARTS, len(self.lower)))
        return max(self._stretch(q) for q in starts)

    def _stretch(self, q: np.ndarray) -> float:
        """Climb from a posture to a locally farthest one, in place; return its distance [m]."""
        for _ in range(_REACH_SWEEPS):
            for i in range(len(q)):
                ahead, aside, behind = (self._distance(q, i, angle) ** 2 for angle in (0.0, np.pi / 2.0, np.pi))
                peak = np.arctan2(aside - (ahead + behind) / 2.0, (ahead - behind) / 2.0)
                turns = peak + np.array([-2.0, 0.0, 2.0]) * np.pi
                inside = turns[(self.lower[i] < turns) & (turns < self.upper[i])]
                candidates = np.array([*inside, self.lower[i], self.upper[i]])
                q[i] = candidates[np.argmax([self._distance(q, i, angle) for angle in candidates])]
        return float(np.linalg.norm(self.wrist(q)[:3, 3] - self.shoulder))

    def _distance(self, q: np.ndarray, joint: int, angle: float) -> float:
        """Distance from shoulder to wrist [m] with one joint set to an angle [rad]."""
        changed = q.copy()
        changed[joint] = angle
        return float(np.linalg.norm(self.wrist(changed)[:3, 3] - self.shoulder))


class Robot:
    """Two arms and the rigid-body model they belong to.

    Not thread-safe: `fk` and `gravity_torque` share one Pinocchio workspace. `copy` gives another thread its own.

    Attributes:
        name: The robot's name.
        base: The body in whose frame wrist poses are given.
        arms: Left, then right.
        joint_names: Names in the order of q.
        lower: Lower joint limits [rad], shape (nq,).
        upper: Upper joint limits [rad], shape (nq,).
        model_hash: SHA-256 of the model file and its description, in hexadecimal.
    """

    def __init__(
        self,
        name: str,
        base: str,
        arms: tuple[ArmChain, ArmChain],
        model: pin.Model,
        base_frame: int,
        wrist_frames: tuple[int, int],
        order: np.ndarray,
        model_hash: str,
    ) -> None:
        """Keep the parts `load` has checked; `order[i]` is the place of wire joint i in the model's vectors."""
        self.name = name
        self.base = base
        self.arms = arms
        self.joint_names = arms[0].joint_names + arms[1].joint_names
        self.lower = np.concatenate([arm.lower for arm in arms])
        self.upper = np.concatenate([arm.upper for arm in arms])
        self.model_hash = model_hash
        self._model = model
        self._data = model.createData()
        self._base_frame = base_frame
        self._wrist_frames = wrist_frames
        self._order = order
        self._in_wire_order = bool((order == np.arange(len(order))).all())

    @classmethod
    def load(cls, description: RobotDescription) -> "Robot":
        """Build the robot a description names.

        Args:
            description: A parsed description; its model file is URDF or MJCF.

        Returns:
            The robot, all joints outside the arms locked at zero.

        Raises:
            RobotError: The file cannot be read as a robot, a joint or frame is missing, a joint is not revolute or
                has no limits, or an arm's joints are not one chain.
        """
        full = _read_model(description.model)
        names = description.arm_joints
        _check_joints(description, full)
        locked = [full.getJointId(name) for name in list(full.names)[1:] if name not in names]
        model = pin.buildReducedModel(full, locked, pin.neutral(full))
        base_frame = model.getFrameId(description.base)
        if model.frames[base_frame].parentJoint != 0:
            raise RobotError(description.source, f"base {description.base} moves with the arms")
        T_world_base = model.frames[base_frame].placement
        left, right = description.arms
        wrists = (_add_wrist(model, left), _add_wrist(model, right))
        return cls(
            name=description.name,
            base=description.base,
            arms=(
                _chain(description, model, left, T_world_base),
                _chain(description, model, right, T_world_base),
            ),
            model=model,
            base_frame=base_frame,
            wrist_frames=wrists,
            order=np.array([model.joints[model.getJointId(name)].idx_q for name in names]),
            model_hash=_hash(description.model, description.source),
        )

    @property
    def nq(self) -> int:
        """Number of arm joints, both arms together."""
        return len(self.joint_names)

    def copy(self) -> "Robot":
        """Make a robot that shares the model and owns its workspace."""
        return Robot(
            self.name,
            self.base,
            self.arms,
            self._model,
            self._base_frame,
            self._wrist_frames,
            self._order,
            self.model_hash,
        )

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forward kinematics of both wrists.

        Args:
            q: Joint positions [rad], shape (nq,).

        Returns:
            `T_base_wrist` of the left and of the right arm, each of shape (4, 4).
        """
        pin.framesForwardKinematics(self._model, self._data, self._to_model(q))
        T_base_world = self._data.oMf[self._base_frame].inverse()
        left, right = (T_base_world * self._data.oMf[frame] for frame in self._wrist_frames)
        return left.homogeneous, right.homogeneous

    def wrist_errors(
        self, q: np.ndarray, left_wrist: np.ndarray, right_wrist: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """How far the wrists are from their targets.

        Args:
            q: Joint positions [rad], shape (nq,).
            left_wrist: Target `T_base_wrist` of the left arm, shape (4, 4).
            right_wrist: Target of the right arm, likewise.

        Returns:
            Distance of each wrist from its target [m] and angle between them [rad], each of shape (2,).
        """
        pairs = list(zip(self.fk(q), (left_wrist, right_wrist), strict=True))
        distances = [np.linalg.norm(wrist[:3, 3] - target[:3, 3]) for wrist, target in pairs]
        angles = [np.linalg.norm(pin.log3(wrist[:3, :3] @ target[:3, :3].T)) for wrist, target in pairs]
        return np.array(distances), np.array(angles)

    def gravity_torque(self, q: np.ndarray) -> np.ndarray:
        """Joint torques that hold the arms still against gravity: the recursive Newton-Euler algorithm at v = a = 0.

        Args:
            q: Joint positions [rad], shape (nq,).

        Returns:
            Torques [N m], shape (nq,), a fresh array.
        """
        torque = pin.computeGeneralizedGravity(self._model, self._data, self._to_model(q))
        return torque if self._in_wire_order else torque[self._order]

    def _to_model(self, q: np.ndarray) -> np.ndarray:
        if self._in_wire_order:
            return q
        ordered = np.empty(len(q))
        ordered[self._order] = q
        return ordered


def _read_model(path: Path) -> pin.Model:
    read = pin.buildModelFromUrdf if path.suffix.lower() == ".urdf" else pin.buildModelFromMJCF
    try:
        model = read(str(path))
    except (ValueError, RuntimeError, IndexError) as error:
        reason = str(error).strip().splitlines() or [type(error).__name__]
        raise RobotError(path, f"Pinocchio cannot read it ({reason[0]})") from None
    names = list(model.names)
    if doubled := next((name for name in names if names.count(name) > 1), None):
        # Pinocchio reads a robot once for every <worldbody> of the file.
        raise RobotError(path, f"joint {doubled} appears twice; an MJCF needs exactly one <worldbody>")
    return model


def _check_joints(description: RobotDescription, model: pin.Model) -> None:
    if not model.existFrame(description.base):
        raise RobotError(description.source, f"base {description.base} is not a body of {description.model.name}")
    for name in description.arm_joints:
        if not model.existJointName(name):
            raise RobotError(description.source, f"joint {name} is not in {description.model.name}")
        joint = model.joints[model.getJointId(name)]
        if joint.nq != 1 or not joint.shortname().startswith("JointModelR"):
            raise RobotError(
                description.source, f"joint {name} is not a revolute joint with limits ({joint.shortname()})"
            )
        lower, upper = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        if not (np.isfinite(lower) and np.isfinite(upper) and lower < upper and upper - lower < 1e3):
            raise RobotError(
                description.source, f"joint {name} has no usable position limits ({lower:g} to {upper:g} rad)"
            )


def _add_wrist(model: pin.Model, arm: ArmDescription) -> int:
    rotation = pin.rpy.rpyToMatrix(*arm.wrist.rpy)
    placement = pin.SE3(rotation, np.array(arm.wrist.xyz))
    joint = model.getJointId(arm.wrist.joint)
    # The prefix keeps it apart from a frame of that name in the model file.
    return model.addFrame(pin.Frame(f"wrist:{arm.wrist.name}", joint, placement, pin.FrameType.OP_FRAME))


def _chain(description: RobotDescription, model: pin.Model, arm: ArmDescription, T_world_base: pin.SE3) -> ArmChain:
    parent, placements, axes, rows, inertias = 0, [], [], [], []
    for name in arm.joints:
        index = model.getJointId(name)
        if model.parents[index] != parent:
            raise RobotError(
                description.source,
                f"joint {name} does not follow {model.names[parent] if parent else description.base} in the model",
            )
        placement = model.jointPlacements[index]
        placements.append((placement if parent else T_world_base.inverse() * placement).homogeneous)
        axes.append(_axis(model.joints[index]))
        rows.append(model.joints[index].idx_q)
        inertias.append(model.inertias[index])
        parent = index
    rotation = pin.rpy.rpyToMatrix(*arm.wrist.rpy)
    return ArmChain(
        side=arm.side,
        joint_names=arm.joints,
        placements=tuple(placements),
        axes=tuple(axes),
        T_last_wrist=pin.SE3(rotation, np.array(arm.wrist.xyz)).homogeneous,
        lower=model.lowerPositionLimit[rows],
        upper=model.upperPositionLimit[rows],
        masses=tuple(inertia.mass for inertia in inertias),
        centers=tuple(inertia.lever.copy() for inertia in inertias),
        gravity=T_world_base.rotation.T @ model.gravity.linear,
    )


def _axis(joint: pin.JointModel) -> np.ndarray:
    """Rotation axis in the joint's frame: the angular part of its motion subspace, whatever Pinocchio's joint type."""
    data = joint.createData()
    joint.calc(data, np.zeros(joint.idx_q + 1))
    return np.asarray(data.S).reshape(6)[3:].copy()


def _hash(*paths: Path) -> str:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()
