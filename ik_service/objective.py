"""The cost of one arm: terms, weights, and its exact derivatives.

    f(q) = position |p - p_target|^2 + rotation |log3(R R_target^T)|^2
           + regularization |q|^2 + smoothness |q - q_last|^2 + elbow |p_elbow - p_elbow_target|^2

Without its last term this is the cost of the OpenWBT and xr_teleoperate solvers. It has no term that couples the arms,
so each arm is a problem of its own. Weights are inputs of the compiled functions: one kernel serves every preset.

Gradient and Hessian are written in closed form. For revolute joints with axes a_i and levers l_i = a_i x (p - o_i),
with i <= j:

- d2p / dq_i dq_j = a_i x l_j.
- The gradient of |w|^2, w = log3(R R_target^T), is 2 a_i . w, because the logarithm's derivative maps w to itself.
- Half its Hessian is k a_i . a_j + (1 - k) (a_i . u)(a_j . u) + w . (a_i x a_j) / 2, with u = w / |w| and k = (|w|/2)
  cot(|w|/2). This follows from the inverse left Jacobian of SO(3) (J. Sola et al., "A micro Lie theory for state
  estimation in robotics", 2018, eq. 146) and from da_j / dq_i = a_i x a_j.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from ik_service.chains import ArmChain
from ik_service.kinematics import rotation_error, wrist_pose

Expression = Any
"""A `casadi.SX` or a `casadi.MX`."""

WEIGHTS = ("position", "rotation", "regularization", "smoothness", "elbow", "hyperextension", "enough")
"""What weighs the terms of an arm's cost, as described in `preset.Preset`; and at the end, which error part of the cost
is small enough for a descent to end (0 where it shall settle)."""

MISSED = 1e-4
"""Error part of the cost from which on a target counts as missed: 1.4 mm or half a degree of weights 50 and 1."""

LOST = 1.0
"""Error part of the cost beyond which an arm is not slowed any further: 140 mm or 57 degrees of weights 50 and 1."""


@dataclass(frozen=True)
class ArmProblem:
    """What an arm is to do, as symbols or expressions.

    Attributes:
        q_last: Joint positions the smoothness term pulls to [rad], shape (n,).
        p_target: Target position [m], shape (3,).
        quaternion_target: Target orientation wxyz, shape (4,).
        weights: As in `WEIGHTS`, shape (7,).
        p_elbow_target: Where the elbow is wished [m], shape (3,).
    """

    q_last: Expression
    p_target: Expression
    quaternion_target: Expression
    weights: Expression
    p_elbow_target: Expression

    @staticmethod
    def size(n: int) -> int:
        """Length of the vector that holds the problem of an arm of n joints."""
        return n + 17

    @classmethod
    def split(cls, vector: Expression, n: int) -> "ArmProblem":
        """Take a vector apart, in the order of the attributes."""
        parts = ca.vertsplit(vector, [0, n, n + 3, n + 7, n + 14, n + 17])
        return cls(*parts)

    @staticmethod
    def slowed(vector: ca.MX, n: int, retreat: ca.MX, error: ca.MX) -> ca.MX:
        """Raise the smoothness of a problem.

        Args:
            vector: A problem.
            n: Number of joints.
            retreat: What to multiply the error with.
            error: Part of the cost that errors make; counts from `MISSED` up to `LOST`.

        Returns:
            The problem of an arm in less of a hurry.
        """
        more = retreat * ca.fmin(ca.fmax(error - MISSED, 0.0), LOST)
        smoothness = n + 3 + 4 + WEIGHTS.index("smoothness")
        return ca.vertcat(vector[:smoothness], vector[smoothness] + more, vector[smoothness + 1 :])

    @staticmethod
    def idle(vector: Expression, n: int) -> Expression:
        """Make a problem of an arm that has no target and stays where it is.

        Args:
            vector: A problem.
            n: Number of joints.

        Returns:
            The same with no weight but a smoothness of 1.
        """
        weights = ca.DM([float(key == "smoothness") for key in WEIGHTS])
        return ca.vertcat(vector[: n + 7], weights, vector[n + 7 + len(WEIGHTS) :])

    def join(self) -> Expression:
        """Put the problem into one vector."""
        return ca.vertcat(self.q_last, self.p_target, self.quaternion_target, self.weights, self.p_elbow_target)


@dataclass(frozen=True)
class Geometry:
    """What the Hessian needs of a point, so that forward kinematics is done once; all in the base frame.

    Attributes:
        levers: Derivatives of the wrist's position [m/rad], n of shape (3,).
        axes: Joint axes, n of shape (3,).
        e: Position error [m], shape (3,).
        angle: Rotation error [rad].
        u: Its axis, shape (3,).
        curvature: (angle / 2) cot(angle / 2).
        elbow_levers: Derivatives of the elbow's position [m/rad], one of shape (3,) for each joint above the elbow.
        elbow_e: Distance of the elbow from where it is wished [m], shape (3,).
        hyperextended: 1 where the elbow is beyond `ArmChain.straight_elbow`, else 0.
    """

    levers: list[ca.SX]
    axes: list[ca.SX]
    e: ca.SX
    angle: ca.SX
    u: ca.SX
    curvature: ca.SX
    elbow_levers: list[ca.SX]
    elbow_e: ca.SX
    hyperextended: ca.SX

    @staticmethod
    def size(chain: ArmChain) -> int:
        """Length of the vector that holds the geometry of an arm."""
        return 6 * len(chain.joint_names) + 12 + 3 * (chain.elbow or 0)

    def join(self) -> ca.SX:
        """Put the geometry into one vector."""
        parts = [*self.levers, *self.axes, self.e, self.angle, self.u, self.curvature, self.elbow_e]
        return ca.vertcat(*parts, self.hyperextended, *self.elbow_levers)

    @classmethod
    def split(cls, vector: ca.SX, chain: ArmChain) -> "Geometry":
        """Take a vector apart."""
        n, above = len(chain.joint_names), chain.elbow or 0
        widths = [3] * (2 * n) + [3, 1, 3, 1, 3, 1] + [3] * above
        ends = [sum(widths[:i]) for i in range(len(widths) + 1)]
        parts = ca.vertsplit(vector, ends)
        e, angle, u, curvature, elbow_e, hyperextended = parts[2 * n : 2 * n + 6]
        return cls(parts[:n], parts[n : 2 * n], e, angle, u, curvature, parts[2 * n + 6 :], elbow_e, hyperextended)


@dataclass(frozen=True)
class ArmCost:
    """Symbolic cost of one arm at a point, and its derivatives.

    Attributes:
        value: f.
        gradient: Its gradient, n scalars.
        geometry: What `arm_hessian` needs.
        position_error: |p - p_target| [m].
        rotation_error: |log3(R R_target^T)| [rad].
    """

    value: ca.SX
    gradient: list[ca.SX]
    geometry: Geometry
    position_error: ca.SX
    rotation_error: ca.SX


def arm_cost(chain: ArmChain, q: ca.SX, problem: ArmProblem) -> ArmCost:
    """Write down the cost of an arm.

    Args:
        chain: The arm.
        q: Joint positions [rad], shape (n,).
        problem: Targets and weights.

    Returns:
        Value, gradient, geometry and errors as expressions of the arguments.
    """
    wrist = wrist_pose(chain, q)
    position, rotation, regularization, smoothness, elbow, hyperextension, _ = ca.vertsplit(problem.weights)
    e = wrist.p - problem.p_target
    error = rotation_error(wrist.quaternion, problem.quaternion_target)
    squared_distance = ca.sumsqr(e)
    value = (
        position * squared_distance
        + rotation * error.angle**2
        + regularization * ca.sumsqr(q)
        + smoothness * ca.sumsqr(q - problem.q_last)
    )
    gradient = [
        2.0 * position * ca.dot(lever, e)
        + 2.0 * rotation * error.angle * ca.dot(axis, error.axis)
        + 2.0 * regularization * q[i]
        + 2.0 * smoothness * (q[i] - problem.q_last[i])
        for i, (lever, axis) in enumerate(zip(wrist.levers, wrist.axes, strict=True))
    ]
    elbow_e, elbow_levers, hyperextended = ca.SX.zeros(3), [], ca.SX(0)
    if chain.elbow is not None:
        p_elbow = wrist.origins[chain.elbow]
        elbow_e = p_elbow - problem.p_elbow_target
        value += elbow * ca.sumsqr(elbow_e)
        for i in range(chain.elbow):
            elbow_levers.append(ca.cross(wrist.axes[i], p_elbow - wrist.origins[i]))
            gradient[i] += 2.0 * elbow * ca.dot(elbow_levers[i], elbow_e)
        angle, side = chain.straight_elbow
        beyond = side * (q[chain.elbow] - angle)
        hyperextended = beyond > 0.0
        excess = hyperextended * beyond
        value += hyperextension * excess**2
        gradient[chain.elbow] += 2.0 * hyperextension * side * excess
    geometry = Geometry(
        wrist.levers, wrist.axes, e, error.angle, error.axis, error.curvature, elbow_levers, elbow_e, hyperextended
    )
    return ArmCost(value, gradient, geometry, ca.sqrt(squared_distance), error.angle)


def arm_hessian(chain: ArmChain, geometry: Geometry, weights: ca.SX, exact: bool) -> list[list[ca.SX]]:
    """Write down the Hessian of an arm's cost, or the part of it that is positive definite everywhere.

    That part is the Gauss-Newton matrix with the exact curvature of the squared angle. What it leaves out changes sign
    and vanishes with the errors.

    Args:
        chain: The arm.
        geometry: Of the point.
        weights: As in `ArmProblem`; regularization + smoothness > 0.
        exact: Whether the exact Hessian is wanted.

    Returns:
        n x n scalars.
    """
    position, rotation, regularization, smoothness, elbow, hyperextension, _ = ca.vertsplit(weights)
    axes, levers, k, u = geometry.axes, geometry.levers, geometry.curvature, geometry.u
    n, above = len(axes), len(geometry.elbow_levers)
    along = [ca.dot(axis, u) for axis in axes]
    H = [[ca.SX(0)] * n for _ in range(n)]
    for i in range(n):
        by_lever, by_axis = levers[i], k * axes[i]
        by_elbow = geometry.elbow_levers[i] if i < above else ca.SX.zeros(3)
        if exact:
            # Triple products: e . (a_i x l_j) = (e x a_i) . l_j, and the same with w / 2 and a_j.
            by_lever += ca.cross(geometry.e, axes[i])
            by_axis += ca.cross(0.5 * geometry.angle * u, axes[i])
            if i < above:
                by_elbow += ca.cross(geometry.elbow_e, axes[i])
        by_lever, by_axis = 2.0 * position * by_lever, 2.0 * rotation * by_axis
        by_along, by_elbow = 2.0 * rotation * (1.0 - k) * along[i], 2.0 * elbow * by_elbow
        for j in range(i, n):
            entry = ca.dot(by_lever, levers[j]) + ca.dot(by_axis, axes[j]) + by_along * along[j]
            if j < above:
                entry += ca.dot(by_elbow, geometry.elbow_levers[j])
            H[i][j] = H[j][i] = entry
        H[i][i] += 2.0 * (regularization + smoothness)
    if chain.elbow is not None:
        H[chain.elbow][chain.elbow] += 2.0 * hyperextension * geometry.hyperextended
    return H
