"""Symbolic forward kinematics of one arm, in CasADi.

Built joint by joint from the placements Pinocchio reports. Numerical noise in them is snapped to zeros and ones, so
that the expression holds no multiplications by either. Orientation is carried twice: as a matrix, whose columns
give the joint axes, and as a unit quaternion, from which the rotation error has an accurate logarithm at every angle,
half a turn included.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin

from ik_service.chains import ArmChain, WaistChain

NOISE = 1e-12
"""Entries of a placement this close to an integer are that integer [m or 1]."""

TINY = 1e-300
"""Added under a square root to keep 0/0 out of the logarithm; far below any squared angle that float64 arithmetic
produces."""


@dataclass(frozen=True)
class WristPose:
    """Symbolic wrist pose of an arm and what its derivatives are made of; everything in the base frame.

    Attributes:
        p: Wrist position [m], shape (3,).
        R: Wrist orientation, shape (3, 3).
        quaternion: The same orientation as a unit quaternion wxyz, shape (4,); its sign is arbitrary.
        axes: Rotation axis of each joint, n of shape (3,).
        levers: Derivative of p with respect to each joint, a_i x (p - o_i) [m/rad], n of shape (3,).
        origins: Origin o_i of each joint [m], n of shape (3,).
        rotations: Orientation of the body each joint moves, n of shape (3, 3).
    """

    p: ca.SX
    R: ca.SX
    quaternion: ca.SX
    axes: list[ca.SX]
    levers: list[ca.SX]
    origins: list[ca.SX]
    rotations: list[ca.SX]


def wrist_pose(chain: ArmChain, q: ca.SX) -> WristPose:
    """Forward kinematics.

    Args:
        chain: The arm.
        q: Symbolic joint positions [rad], shape (n,).

    Returns:
        The wrist pose with its first-order geometry.
    """
    p, R, quaternion = ca.SX.zeros(3), ca.SX.eye(3), ca.SX([1.0, 0.0, 0.0, 0.0])
    axes, origins, rotations = [], [], []
    for i, (placement, axis) in enumerate(zip(chain.placements, chain.axes, strict=True)):
        p, R, quaternion = _compose(p, R, quaternion, placement)
        axes.append(R @ _constant(axis))
        origins.append(p)
        half_sin, half_cos = ca.sin(q[i] / 2.0), ca.cos(q[i] / 2.0)
        # Double-angle formulas: one sine and cosine a joint serve the quaternion and the matrix.
        sin, cos = 2.0 * half_sin * half_cos, 1.0 - 2.0 * half_sin * half_sin
        outer = _constant(np.outer(axis, axis))
        R = R @ (outer + cos * (ca.SX.eye(3) - outer) + sin * _constant(pin.skew(axis)))
        rotations.append(R)
        quaternion = quaternion_product(quaternion, ca.vertcat(half_cos, half_sin * _constant(axis)))
    p, R, quaternion = _compose(p, R, quaternion, chain.T_last_wrist)
    levers = [ca.cross(axis, p - origin) for axis, origin in zip(axes, origins, strict=True)]
    return WristPose(p, R, quaternion, axes, levers, origins, rotations)


def waist_motion(waist: WaistChain, angles: ca.SX) -> tuple[ca.SX, ca.SX]:
    """How far the waist carries the shoulders: the symbolic form of `WaistChain.motion`.

    Args:
        waist: The waist.
        angles: Its joint positions [rad], shape (n,).

    Returns:
        Rotation, shape (3, 3), and translation [m], shape (3,).
    """
    p, R, straight = ca.SX.zeros(3), ca.SX.eye(3), np.eye(4)
    for i, (placement, axis) in enumerate(zip(waist.placements, waist.axes, strict=True)):
        p, R, _ = _compose(p, R, ca.SX([1.0, 0.0, 0.0, 0.0]), placement)
        outer = _constant(np.outer(axis, axis))
        R = R @ (outer + ca.cos(angles[i]) * (ca.SX.eye(3) - outer) + ca.sin(angles[i]) * _constant(pin.skew(axis)))
        straight = straight @ placement
    back = np.linalg.inv(straight)
    return R @ _constant(back[:3, :3]), p + R @ _constant(back[:3, 3])


def gravity_torque(chain: ArmChain, q: ca.SX, gravity: ca.SX) -> ca.SX:
    """Joint torques that hold the arm still against gravity.

    Static equilibrium of what hangs behind each joint: tau_i = -a_i . sum_k m_k (c_k - o_i) x g over the bodies k from
    joint i outwards. The same numbers as Pinocchio's recursive Newton-Euler algorithm at v = a = 0, computed where the
    solution is; calling Pinocchio for them costs more than a Newton iteration.

    Args:
        chain: The arm.
        q: Symbolic joint positions [rad], shape (n,).
        gravity: Acceleration of gravity in the frame the arm is mounted in [m/s^2], shape (3,).

    Returns:
        Torques [N m], shape (n,).
    """
    pose = wrist_pose(chain, q)
    mass, first_moment, torques = 0.0, ca.SX.zeros(3), []
    for i in reversed(range(len(chain.masses))):
        center = pose.origins[i] + pose.rotations[i] @ _constant(chain.centers[i])
        mass, first_moment = mass + chain.masses[i], first_moment + chain.masses[i] * center
        torques.append(-ca.dot(pose.axes[i], ca.cross(first_moment - mass * pose.origins[i], gravity)))
    return ca.vertcat(*reversed(torques))


def quaternion_product(a: ca.SX, b: ca.SX) -> ca.SX:
    """Hamilton product of two quaternions wxyz, each of shape (4,)."""
    return ca.vertcat(
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def quaternion_of(R: ca.SX) -> ca.SX:
    """Unit quaternion wxyz of a rotation matrix, accurate for every rotation.

    Shepperd's method (S. W. Shepperd, "Quaternion from Rotation Matrix", Journal of Guidance and Control 1, 1978): of
    four formulas, the one that divides by the largest component is taken.

    Args:
        R: Symbolic rotation matrix, shape (3, 3).

    Returns:
        The quaternion, shape (4,), of arbitrary sign.
    """
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    squares = [1.0 + trace] + [1.0 - trace + 2.0 * R[i, i] for i in range(3)]
    wx, wy, wz = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    xy, xz, yz = R[1, 0] + R[0, 1], R[2, 0] + R[0, 2], R[2, 1] + R[1, 2]
    candidates = [
        ca.vertcat(squares[0], wx, wy, wz),
        ca.vertcat(wx, squares[1], xy, xz),
        ca.vertcat(wy, xy, squares[2], yz),
        ca.vertcat(wz, xz, yz, squares[3]),
    ]
    largest, chosen = squares[0], candidates[0]
    for square, candidate in zip(squares[1:], candidates[1:], strict=True):
        chosen = ca.if_else(square > largest, candidate, chosen)
        largest = ca.fmax(square, largest)
    return chosen / (2.0 * ca.sqrt(largest))


@dataclass(frozen=True)
class RotationError:
    """The rotation vector w = log3(R R_target^T) in the base frame, and what its derivatives need.

    Attributes:
        angle: |w| in [0, pi] [rad].
        axis: w / |w|, shape (3,); zero where w is.
        curvature: (|w| / 2) cot(|w| / 2): 1 for no error, 0 for half a turn.
    """

    angle: ca.SX
    axis: ca.SX
    curvature: ca.SX


def rotation_error(quaternion: ca.SX, target: ca.SX) -> RotationError:
    """Logarithm of the rotation that takes the target to the wrist.

    The half angle comes from atan2 of the quaternion's vector and scalar parts, which is accurate at every angle. At
    exactly half a turn both axes are right; one of them is returned.

    Args:
        quaternion: Wrist orientation wxyz, shape (4,).
        target: Target orientation wxyz, shape (4,).

    Returns:
        Angle, axis and curvature.
    """
    conjugate = ca.vertcat(target[0], -target[1], -target[2], -target[3])
    difference = quaternion_product(quaternion, conjugate)
    scalar = ca.fabs(difference[0])
    vector = ca.if_else(difference[0] < 0.0, -difference[1:], difference[1:])
    norm = ca.sqrt(ca.sumsqr(vector) + TINY)
    half_angle = ca.atan2(norm, scalar)
    return RotationError(2.0 * half_angle, vector / norm, half_angle * scalar / norm)


def _compose(p: ca.SX, R: ca.SX, quaternion: ca.SX, placement: np.ndarray) -> tuple[ca.SX, ca.SX, ca.SX]:
    x, y, z, w = pin.Quaternion(placement[:3, :3]).coeffs()
    return (
        p + R @ _constant(placement[:3, 3]),
        R @ _constant(placement[:3, :3]),
        quaternion_product(quaternion, _constant(np.array([w, x, y, z]))),
    )


def _constant(values: np.ndarray) -> ca.SX:
    nearest = np.round(values)
    return ca.SX(ca.sparsify(ca.DM(np.where(np.abs(values - nearest) < NOISE, nearest, values))))
