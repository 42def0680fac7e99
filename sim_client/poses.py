"""Poses between poses, and how far apart two of them are."""

import mujoco
import numpy as np

from ik_proto import Array


def interpolate(T_begin: Array, T_end: Array, fraction: float) -> Array:
    """Move from one pose to another: position on a line, rotation about one axis.

    Args:
        T_begin: Pose at fraction 0, shape (4, 4) [m].
        T_end: Pose at fraction 1, same frame.
        fraction: How far, 0 to 1.

    Returns:
        The pose between them; at 0 exactly `T_begin`, at 1 exactly `T_end`.
    """
    if fraction <= 0.0:
        return T_begin.copy()
    if fraction >= 1.0:
        return T_end.copy()
    T = np.eye(4)
    T[:3, 3] = (1.0 - fraction) * T_begin[:3, 3] + fraction * T_end[:3, 3]
    T[:3, :3] = T_begin[:3, :3] @ rotation_about(fraction * rotation_vector(T_begin[:3, :3].T @ T_end[:3, :3]))
    return T


def rotation_vector(R: Array) -> Array:
    """Axis times angle of a rotation, shape (3,) [rad]; the angle is at most pi."""
    wxyz, vector = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(R).ravel())
    mujoco.mju_quat2Vel(vector, wxyz, 1.0)
    return vector


def rotation_about(vector: Array) -> Array:
    """Rotation about an axis by the length of that axis, shape (3, 3); inverse of `rotation_vector`."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    wxyz, R = np.empty(4), np.empty(9)
    mujoco.mju_axisAngle2Quat(wxyz, vector / angle, angle)
    mujoco.mju_quat2Mat(R, wxyz)
    return R.reshape(3, 3)


def difference(T_a: Array, T_b: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses of the same frame."""
    return (
        float(np.linalg.norm(T_a[:3, 3] - T_b[:3, 3])),
        float(np.linalg.norm(rotation_vector(T_a[:3, :3].T @ T_b[:3, :3]))),
    )


def smooth_step(x: float) -> float:
    """Rise from 0 to 1 over 0 <= x <= 1 with no speed and no acceleration at either end."""
    x = min(max(x, 0.0), 1.0)
    return x * x * x * (x * (6.0 * x - 15.0) + 10.0)
