"""The robot as the solver sees it: two serial arms, a waist that carries both, every other joint locked at zero.

Pinocchio reads the model file (URDF or MJCF) and stays the authority: forward kinematics and gravity torques come
from it, and the symbolic kinematics of the solver are built from the placements it reports. Vectors of joint values
are in the order of the wire: left arm then right arm, as the description lists them.
"""

import hashlib
from pathlib import Path

import numpy as np
import pinocchio as pin

from ik_proto.robots import ArmDescription, RobotDescription, RobotError
from ik_service.chains import ArmChain, WaistChain
from ik_service.collision import CollisionModel


class Robot:
    """Two arms, their waist, and the rigid-body model they belong to.

    Not thread-safe: `fk` and `gravity_torque` share one Pinocchio workspace. `copy` gives another thread its own.

    Attributes:
        name: The robot's name.
        base: The body in whose frame wrist poses are given.
        arms: Left, then right.
        waist: The waist, as measured waist joints bend it.
        collision: Capsules and the pairs checked against each other.
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
        waist: WaistChain,
        collision: CollisionModel,
        model: pin.Model,
        base_frame: int,
        wrist_frames: tuple[int, int],
        model_hash: str,
    ) -> None:
        """Keep the parts `load` has checked."""
        self.name = name
        self.base = base
        self.arms = arms
        self.waist = waist
        self.collision = collision
        self.joint_names = arms[0].joint_names + arms[1].joint_names
        self.lower = np.concatenate([arm.lower for arm in arms])
        self.upper = np.concatenate([arm.upper for arm in arms])
        self.model_hash = model_hash
        self._model = model
        self._data = model.createData()
        self._base_frame = base_frame
        self._wrist_frames = wrist_frames
        self._arm_order = _places(model, self.joint_names)
        self._waist_order = _places(model, waist.joint_names)

    @classmethod
    def load(cls, description: RobotDescription) -> "Robot":
        """Build the robot a description names.

        Args:
            description: A parsed description; its model file is URDF or MJCF.

        Returns:
            The robot, all joints outside arms and waist locked at zero.

        Raises:
            RobotError: The file cannot be read as a robot, a joint or frame is missing, a joint is not revolute or
                has no limits, joints of an arm or of the waist are not one chain, or a capsule has no place.
        """
        full = _read_model(description.model)
        names = description.arm_joints + description.waist
        _check_joints(description, full)
        locked = [full.getJointId(name) for name in list(full.names)[1:] if name not in names]
        model = pin.buildReducedModel(full, locked, pin.neutral(full))
        base_frame = model.getFrameId(description.base)
        if model.frames[base_frame].parentJoint != 0:
            raise RobotError(description.source, f"base {description.base} moves with the arms or the waist")
        T_world_base = model.frames[base_frame].placement.copy()  # adding frames moves them in memory
        waist = _waist(description, model, T_world_base)
        left, right = description.arms
        wrists = (_add_wrist(model, left), _add_wrist(model, right))
        return cls(
            name=description.name,
            base=description.base,
            arms=(
                _chain(description, model, left, T_world_base),
                _chain(description, model, right, T_world_base),
            ),
            waist=waist,
            collision=CollisionModel.of(description, model),
            model=model,
            base_frame=base_frame,
            wrist_frames=wrists,
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
            self.waist,
            self.collision,
            self._model,
            self._base_frame,
            self._wrist_frames,
            self.model_hash,
        )

    def fk(self, q: np.ndarray, waist: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Forward kinematics of both wrists.

        Args:
            q: Joint positions [rad], shape (nq,).
            waist: Waist joint positions [rad]; None for a straight waist.

        Returns:
            `T_base_wrist` of the left and of the right arm, each of shape (4, 4).
        """
        pin.framesForwardKinematics(self._model, self._data, self._to_model(q, waist))
        T_base_world = self._data.oMf[self._base_frame].inverse()
        left, right = (T_base_world * self._data.oMf[frame] for frame in self._wrist_frames)
        return left.homogeneous, right.homogeneous

    def wrist_errors(
        self, q: np.ndarray, left_wrist: np.ndarray, right_wrist: np.ndarray, waist: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """How far the wrists are from their targets.

        Args:
            q: Joint positions [rad], shape (nq,).
            left_wrist: Target `T_base_wrist` of the left arm, shape (4, 4).
            right_wrist: Target of the right arm, likewise.
            waist: Waist joint positions [rad]; None for a straight waist.

        Returns:
            Distance of each wrist from its target [m] and angle between them [rad], each of shape (2,).
        """
        pairs = list(zip(self.fk(q, waist), (left_wrist, right_wrist), strict=True))
        distances = [np.linalg.norm(wrist[:3, 3] - target[:3, 3]) for wrist, target in pairs]
        angles = [np.linalg.norm(pin.log3(wrist[:3, :3] @ target[:3, :3].T)) for wrist, target in pairs]
        return np.array(distances), np.array(angles)

    def gravity_torque(self, q: np.ndarray, waist: np.ndarray | None = None) -> np.ndarray:
        """Joint torques that hold the arms still against gravity: the recursive Newton-Euler algorithm at v = a = 0.

        Args:
            q: Joint positions [rad], shape (nq,).
            waist: Waist joint positions [rad]; None for a straight waist.

        Returns:
            Torques [N m], shape (nq,), a fresh array.
        """
        return pin.computeGeneralizedGravity(self._model, self._data, self._to_model(q, waist))[self._arm_order]

    def _to_model(self, q: np.ndarray, waist: np.ndarray | None) -> np.ndarray:
        ordered = np.zeros(self._model.nq)
        ordered[self._arm_order] = q
        if waist is not None:
            ordered[self._waist_order] = waist
        return ordered


def _places(model: pin.Model, names: tuple[str, ...]) -> np.ndarray:
    return np.array([model.joints[model.getJointId(name)].idx_q for name in names], dtype=int)


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
    for name in description.arm_joints + description.waist:
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


def _waist(description: RobotDescription, model: pin.Model, T_world_base: pin.SE3) -> WaistChain:
    indices = _series(description, model, description.waist, 0)
    placements = [model.jointPlacements[index] for index in indices]
    if indices:
        placements[0] = T_world_base.inverse() * placements[0]
    return WaistChain(
        joint_names=description.waist,
        placements=tuple(placement.homogeneous for placement in placements),
        axes=tuple(_axis(model.joints[index]) for index in indices),
    )


def _chain(description: RobotDescription, model: pin.Model, arm: ArmDescription, T_world_base: pin.SE3) -> ArmChain:
    mount = model.getJointId(description.waist[-1]) if description.waist else 0
    indices = _series(description, model, arm.joints, mount)
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    placements = [model.jointPlacements[index] for index in indices]
    placements[0] = T_world_base.inverse() * data.oMi[mount] * placements[0]
    inertias = [model.inertias[index] for index in indices]
    rows = [model.joints[index].idx_q for index in indices]
    rotation = pin.rpy.rpyToMatrix(*arm.wrist.rpy)
    return ArmChain(
        side=arm.side,
        joint_names=arm.joints,
        placements=tuple(placement.homogeneous for placement in placements),
        axes=tuple(_axis(model.joints[index]) for index in indices),
        T_last_wrist=pin.SE3(rotation, np.array(arm.wrist.xyz)).homogeneous,
        lower=model.lowerPositionLimit[rows],
        upper=model.upperPositionLimit[rows],
        masses=tuple(inertia.mass for inertia in inertias),
        centers=tuple(inertia.lever.copy() for inertia in inertias),
        gravity=T_world_base.rotation.T @ model.gravity.linear,
        elbow=None if arm.elbow is None else arm.joints.index(arm.elbow),
    )


def _series(description: RobotDescription, model: pin.Model, names: tuple[str, ...], parent: int) -> list[int]:
    """Indices of joints that follow each other, the first of them a joint."""
    indices = []
    for name in names:
        index = model.getJointId(name)
        if model.parents[index] != parent:
            raise RobotError(
                description.source,
                f"joint {name} does not follow {model.names[parent] if parent else description.base} in the model",
            )
        indices.append(index)
        parent = index
    return indices


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
