"""The cost of one arm: terms, weights, presets, and its exact derivatives.

    f(q) = position |p - p_target|^2 + rotation |log3(R R_target^T)|^2
           + regularization |q|^2 + smoothness |q - q_last|^2

This is the cost of the OpenWBT and xr_teleoperate solvers. It has no term that couples the arms, so each arm is a
problem of its own.

Gradient and Hessian are written in closed form. For revolute joints with axes a_i and levers l_i = a_i x (p - o_i),
with i <= j:

- d2p / dq_i dq_j = a_i x l_j.
- The gradient of |w|^2, w = log3(R R_target^T), is 2 a_i . w, because the logarithm's derivative maps w to itself.
- Half its Hessian is k a_i . a_j + (1 - k) (a_i . u)(a_j . u) + w . (a_i x a_j) / 2, with u = w / |w| and k = (|w|/2)
  cot(|w|/2). This follows from the inverse left Jacobian of SO(3) (J. Sola et al., "A micro Lie theory for state
  estimation in robotics", 2018, eq. 146) and from da_j / dq_i = a_i x a_j.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from ik_proto.robots import RobotDescription, RobotError
from ik_service.kinematics import RotationError, WristPose, rotation_error, wrist_pose
from ik_service.robot import ArmChain

WEIGHTS = ("position", "rotation", "regularization", "smoothness")


@dataclass(frozen=True)
class Preset:
    """Weights of the cost, and the errors beyond which a converged answer counts as unreachable.

    The regularization of the `openwbt` weights alone leaves settled, reachable targets up to 15 mm and 4.2 degrees
    (0.073 rad) off, and smoothness adds to that while q is on its way. With the default thresholds a target whose
    posture is within 0.5 rad of the request's q counts as reached; a far jump may count as unreachable until the arm
    has come closer.

    Attributes:
        name: Its name in requests and in the robot's description.
        position: Weight of the squared position error [1/m^2].
        rotation: Weight of the squared rotation error [1/rad^2].
        regularization: Weight of the squared distance from q = 0 [1/rad^2].
        smoothness: Weight of the squared distance from the request's q [1/rad^2].
        unreachable_position: Largest position error of a wrist that counts as reached [m].
        unreachable_rotation: Largest rotation error of a wrist that counts as reached [rad].
    """

    name: str
    position: float
    rotation: float
    regularization: float
    smoothness: float
    unreachable_position: float = 0.025
    unreachable_rotation: float = 0.12

    @classmethod
    def of(cls, description: RobotDescription, name: str) -> "Preset":
        """Read a preset from a robot's description.

        Args:
            description: The robot's description.
            name: The preset's name there.

        Returns:
            The preset.

        Raises:
            RobotError: No such preset, a weight missing, negative or unknown, or none that makes the solution unique.
        """
        presets: Mapping[str, Mapping[str, float]] = description.presets
        if name not in presets:
            known = ", ".join(sorted(presets)) or "none"
            raise RobotError(description.source, f"no preset {name}; it has {known}")
        weights = presets[name]
        for weight in WEIGHTS:
            if not weights.get(weight, -1.0) >= 0.0:
                raise RobotError(description.source, f"[presets.{name}] needs {weight}, a number >= 0")
        if not weights["regularization"] + weights["smoothness"] > 0.0:
            raise RobotError(description.source, f"[presets.{name}] needs regularization or smoothness above zero")
        optional = {"unreachable_position", "unreachable_rotation"}
        if unknown := sorted(weights.keys() - set(WEIGHTS) - optional):
            raise RobotError(description.source, f"[presets.{name}] has no use for {unknown[0]}")
        return cls(name, **weights)


@dataclass(frozen=True)
class ArmCost:
    """Symbolic cost of one arm at a point, and its derivatives.

    Attributes:
        value: f.
        gradient: Its gradient, n scalars.
        hessian: Its exact Hessian, n x n scalars.
        position_error: |p - p_target| [m].
        rotation_error: |log3(R R_target^T)| [rad].
    """

    value: ca.SX
    gradient: list[ca.SX]
    hessian: list[list[ca.SX]]
    position_error: ca.SX
    rotation_error: ca.SX


def arm_cost(
    chain: ArmChain, preset: Preset, q: ca.SX, q_last: ca.SX, p_target: ca.SX, quaternion_target: ca.SX
) -> ArmCost:
    """Write down the cost of an arm.

    Args:
        chain: The arm.
        preset: Weights.
        q: Joint positions [rad], shape (n,).
        q_last: Joint positions the smoothness term pulls to [rad], shape (n,).
        p_target: Target position in the base frame [m], shape (3,).
        quaternion_target: Target orientation in the base frame, wxyz, shape (4,).

    Returns:
        Value, derivatives and errors as expressions of the arguments.
    """
    wrist = wrist_pose(chain, q)
    e = wrist.p - p_target
    rotation = rotation_error(wrist.quaternion, quaternion_target)
    squared_distance = ca.sumsqr(e)
    value = (
        preset.position * squared_distance
        + preset.rotation * rotation.angle**2
        + preset.regularization * ca.sumsqr(q)
        + preset.smoothness * ca.sumsqr(q - q_last)
    )
    along = [ca.dot(axis, rotation.axis) for axis in wrist.axes]
    gradient = [
        2.0 * preset.position * ca.dot(lever, e)
        + 2.0 * preset.rotation * rotation.angle * along[i]
        + 2.0 * preset.regularization * q[i]
        + 2.0 * preset.smoothness * (q[i] - q_last[i])
        for i, lever in enumerate(wrist.levers)
    ]
    hessian = _hessian(preset, wrist, rotation, e)
    return ArmCost(value, gradient, hessian, ca.sqrt(squared_distance), rotation.angle)


def arm_convex_hessian(chain: ArmChain, preset: Preset, q: ca.SX, quaternion_target: ca.SX) -> list[list[ca.SX]]:
    """Write down the part of an arm's Hessian that is positive definite everywhere.

    It is the Gauss-Newton matrix with the exact curvature of the squared angle. What it leaves out changes sign and
    vanishes with the errors.

    Args:
        chain: The arm.
        preset: Weights; regularization + smoothness > 0.
        q: Joint positions [rad], shape (n,).
        quaternion_target: Target orientation in the base frame, wxyz, shape (4,).

    Returns:
        n x n scalars.
    """
    wrist = wrist_pose(chain, q)
    rotation = rotation_error(wrist.quaternion, quaternion_target)
    return _hessian(preset, wrist, rotation, None)


def _hessian(preset: Preset, wrist: WristPose, rotation: RotationError, e: ca.SX | None) -> list[list[ca.SX]]:
    """The exact Hessian for a position error e, or its convex part for None."""
    n = len(wrist.axes)
    k, u = rotation.curvature, rotation.axis
    along = [ca.dot(axis, u) for axis in wrist.axes]
    H = [[ca.SX(0)] * n for _ in range(n)]
    for i in range(n):
        by_lever, by_axis = wrist.levers[i], k * wrist.axes[i]
        if e is not None:
            # Triple products: e . (a_i x l_j) = (e x a_i) . l_j, and the same with w / 2 and a_j.
            by_lever += ca.cross(e, wrist.axes[i])
            by_axis += ca.cross(0.5 * rotation.angle * u, wrist.axes[i])
        by_lever, by_axis = 2.0 * preset.position * by_lever, 2.0 * preset.rotation * by_axis
        by_along = 2.0 * preset.rotation * (1.0 - k) * along[i]
        for j in range(i, n):
            entry = ca.dot(by_lever, wrist.levers[j]) + ca.dot(by_axis, wrist.axes[j]) + by_along * along[j]
            H[i][j] = H[j][i] = entry
        H[i][i] += 2.0 * (preset.regularization + preset.smoothness)
    return H
