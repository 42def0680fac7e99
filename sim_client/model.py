"""A robot description as a MuJoCo model specification, checked before anything is built on it.

The base is held: a free joint in the file is removed, so that the arms can be judged without a balance controller.
Frames named `ik_left_wrist` and `ik_right_wrist` are added where the description puts the controlled frames; the file's
own sites are not relied on.
"""

import mujoco
import numpy as np

from ik_proto import Array
from ik_proto.robots import RobotDescription, RobotError

WRIST_SITES = ("ik_left_wrist", "ik_right_wrist")
"""Names of the sites at the controlled frames, left and right."""


def load_spec(description: RobotDescription) -> mujoco.MjSpec:
    """Read the model file of a description, MJCF or URDF.

    Args:
        description: A parsed description.

    Returns:
        An editable specification with the wrist sites in it and without free joints.

    Raises:
        RobotError: The file is not a model, or a body or joint that the description names is missing or of the wrong
            kind.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(description.model))
    except ValueError as error:
        raise RobotError(description.model, one_line(error)) from None
    spec.compiler.fusestatic = False  # A URDF's root link would be merged into the world, and the base frame with it.
    spec.compiler.discardvisual = False
    for joint in [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]:
        spec.delete(joint)
    _check_names(spec, description)
    for site, arm in zip(WRIST_SITES, description.arms, strict=True):
        spec.joint(arm.wrist.joint).parent.add_site(
            name=site, pos=arm.wrist.xyz, quat=_wxyz_from_rpy(arm.wrist.rpy), size=[0.001, 0.001, 0.001], group=5
        )
    return spec


def compile_spec(spec: mujoco.MjSpec, description: RobotDescription) -> mujoco.MjModel:
    """Compile a specification.

    Raises:
        RobotError: MuJoCo refuses the model; one line that says why.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise RobotError(description.model, one_line(error)) from None


def body_pose(data: mujoco.MjData, body: int) -> Array:
    """Pose of a body in the world, shape (4, 4) [m]."""
    return _pose(data.xpos[body], data.xmat[body])


def site_pose(data: mujoco.MjData, site: int) -> Array:
    """Pose of a site in the world, shape (4, 4) [m]."""
    return _pose(data.site_xpos[site], data.site_xmat[site])


def wrist_poses(data: mujoco.MjData, base: int, sites: tuple[int, int]) -> tuple[Array, Array]:
    """Wrist poses `T_pelvis_wrist`, left and right, shape (4, 4) each [m]; the kinematics must be up to date."""
    T_pelvis_world = invert(body_pose(data, base))
    return T_pelvis_world @ site_pose(data, sites[0]), T_pelvis_world @ site_pose(data, sites[1])


def invert(T: Array) -> Array:
    """Inverse of a rigid transform, shape (4, 4)."""
    R, p = T[:3, :3], T[:3, 3]
    inverse = np.eye(4)
    inverse[:3, :3] = R.T
    inverse[:3, 3] = -R.T @ p
    return inverse


def one_line(error: Exception) -> str:
    """The message of an error as one line."""
    return " ".join(str(error).split())


def _pose(position: Array, rotation: Array) -> Array:
    T = np.eye(4)
    T[:3, :3] = rotation.reshape(3, 3)
    T[:3, 3] = position
    return T


def _check_names(spec: mujoco.MjSpec, description: RobotDescription) -> None:
    if spec.body(description.base) is None:
        raise RobotError(description.source, f"base {description.base} is not a body of {description.model.name}")
    for name in (*description.arm_joints, *description.waist, *description.joints):
        joint = spec.joint(name)
        if joint is None:
            raise RobotError(description.source, f"joint {name} is not in {description.model.name}")
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE:
            raise RobotError(description.source, f"joint {name} is not a hinge in {description.model.name}")


def _wxyz_from_rpy(rpy: tuple[float, float, float]) -> Array:
    """Quaternion of fixed-axis roll, pitch, yaw: Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = np.array(rpy) / 2.0
    about_x = np.array([np.cos(roll), np.sin(roll), 0.0, 0.0])
    about_y = np.array([np.cos(pitch), 0.0, np.sin(pitch), 0.0])
    about_z = np.array([np.cos(yaw), 0.0, 0.0, np.sin(yaw)])
    wxyz, product = np.empty(4), np.empty(4)
    mujoco.mju_mulQuat(product, about_z, about_y)
    mujoco.mju_mulQuat(wxyz, product, about_x)
    return wxyz
