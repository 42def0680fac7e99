"""Kinematics of the arms alone: where the wrists are for given arm joints, every other joint at zero.

This is the robot the service solves for: same frames, same joint order, waist straight.
"""

import mujoco
import numpy as np

from ik_proto import Array
from ik_proto.robots import RobotDescription, RobotError
from sim_client.model import WRIST_SITES, body_pose, compile_spec, invert, load_spec, wrist_poses

_REACH_SAMPLES = 1024


class ArmKinematics:
    """Forward kinematics of both arms by MuJoCo.

    Attributes:
        joint_names: Names in the order of q.
        lower: Lower joint limits [rad], shape (n,).
        upper: Upper joint limits [rad], shape (n,).
        shoulders: Origin of the first joint of the left and the right arm, pelvis frame, shape (2, 3) [m].
        reach: Largest distance from shoulder to wrist, left and right, shape (2,) [m]; found by sampling, hence about
            2 % on the small side.
    """

    def __init__(self, description: RobotDescription) -> None:
        """Build the model.

        Raises:
            RobotError: The description does not fit its model file, or an arm joint has no limits.
        """
        self._model = compile_spec(load_spec(description), description)
        self._data = mujoco.MjData(self._model)
        self._base = self._model.body(description.base).id
        left, right = WRIST_SITES
        self._sites = (self._model.site(left).id, self._model.site(right).id)
        self.joint_names = description.arm_joints
        joints = [self._model.joint(name) for name in self.joint_names]
        for joint in joints:
            if not joint.limited[0]:
                raise RobotError(description.model, f"joint {joint.name} has no limits")
        self._addresses = np.array([joint.qposadr[0] for joint in joints])
        self.lower = np.array([joint.range[0] for joint in joints])
        self.upper = np.array([joint.range[1] for joint in joints])
        self.shoulders = self._find_shoulders([arm.joints[0] for arm in description.arms])
        self.reach = self._find_reach()

    def wrists(self, q: Array) -> tuple[Array, Array]:
        """Wrist poses.

        Args:
            q: Arm joints in wire order, shape (n,) [rad].

        Returns:
            `T_pelvis_wrist`, left and right, shape (4, 4) each [m].
        """
        self._data.qpos[:] = 0.0
        self._data.qpos[self._addresses] = q
        mujoco.mj_kinematics(self._model, self._data)
        return wrist_poses(self._data, self._base, self._sites)

    def _find_shoulders(self, names: list[str]) -> Array:
        self._data.qpos[:] = 0.0
        mujoco.mj_kinematics(self._model, self._data)
        T_pelvis_world = invert(body_pose(self._data, self._base))
        anchors = np.array([self._data.joint(name).xanchor for name in names])
        return anchors @ T_pelvis_world[:3, :3].T + T_pelvis_world[:3, 3]

    def _find_reach(self) -> Array:
        samples = np.random.default_rng(0).uniform(self.lower, self.upper, (_REACH_SAMPLES, len(self.lower)))
        wrists = np.array([[T[:3, 3] for T in self.wrists(q)] for q in samples])
        return np.linalg.norm(wrists - self.shoulders, axis=2).max(axis=0)
