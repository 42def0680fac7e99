"""What one arm minimises, as the functions that a descent is made of, and how a request becomes its problem."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ik_service.chains import ArmChain
from ik_service.kinematics import gravity_torque, quaternion_of
from ik_service.newton import Objective, solve_on_free_joints
from ik_service.objective import ArmCost, ArmProblem, Geometry, arm_cost, arm_hessian

ARM_LENGTH = 0.3
"""Size of second derivatives of the wrist's position [m/rad^2]."""

LARGE_ERROR = 1e-2
"""Error part of the cost that tracking does not reach: 14 mm or 6 degrees of weights 50 and 1."""

ERROR_DAMPING = 1.0
"""Levenberg damping of a reaching descent per error part of the cost: far away it is gradient descent, near by Newton
(T. Sugihara, "Solvability-Unconcerned Inverse Kinematics by the Levenberg-Marquardt Method", IEEE Transactions on
Robotics 27, 2011)."""

MIN_PIVOT = 0.08
"""Smallest pivot of a Hessian that counts as safely positive definite, as a multiple of regularization + smoothness."""

BLOCKS = (4, 4, 6)
"""Nesting of the iterations of a descent. Tracking takes 2 or 3 iterations, a random start 10 to 40."""

HINTED_HYPEREXTENSION = 2.0
"""How much more an elbow beyond the straight arm weighs, per weight of its hint [m^2/rad^2].

A hint comes from a person, whose elbow does not bend that way. An arm whose nearly straight elbow has slipped there, as
the person's bend changed its side, finds its way back, and does not stay there until it is straight again. Without a
hint nothing says on which side the elbow should be."""

ARM_OPTIONS = ("position", "rotation", "elbow", "elbow_x", "elbow_y", "elbow_z")
"""Weights of an arm's wrist and elbow, and the unit direction from shoulder to elbow that is wished for (in the base
frame)."""

SHARED_OPTIONS = ("regularization", "smoothness", "hyperextension", "enough", "retreat")
"""What both arms share, see `objective.WEIGHTS` and `preset.Preset`."""


@dataclass(frozen=True)
class Arm:
    """The functions of an arm, made once and shared: generated C holds each once.

    Attributes:
        chain: The arm.
        objective: Its cost, ready for a descent.
        problem: See `arm_problem`.
        remeasured: ([cost, position error, rotation error, iterations, settled], q, problem) -> the same of that q.
        torque: (q, gravity) -> torques that hold it [N m].
    """

    chain: ArmChain
    objective: Objective
    problem: ca.Function
    remeasured: ca.Function
    torque: ca.Function

    @classmethod
    def of(cls, chain: ArmChain) -> "Arm":
        """Make the functions of an arm."""
        objective = arm_objective(chain)
        q, gravity = ca.SX.sym("q", chain.n), ca.SX.sym("gravity", 3)
        torque = ca.Function(f"{chain.side}_torque", [q, gravity], [gravity_torque(chain, q, gravity)], {"cse": True})
        return cls(chain, objective, arm_problem(chain), _remeasured(chain, objective), torque)

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.chain.n

    @property
    def problem_size(self) -> int:
        """Length of a problem."""
        return ArmProblem.size(self.n)


def arm_objective(chain: ArmChain) -> Objective:
    """Make the cost of an arm ready for a descent.

    Args:
        chain: The arm.

    Returns:
        The objective; its problem is an `ArmProblem`, its measures end in position error [m] and rotation error
        [rad].
    """
    return Objective(
        evaluate=_evaluation(chain),
        exact_step=_step(chain, exact=True),
        convex_step=_step(chain, exact=False),
        lower=chain.lower,
        upper=chain.upper,
    )


def arm_problem(chain: ArmChain) -> ca.Function:
    """Build the function that turns a request into the problem of an arm.

    Args:
        chain: The arm, of n joints.

    Returns:
        Function (q, T, arm options, shared options, R, p) -> problem. T is the target in the base frame, row by row,
        shape (16,); R and p are the motion of the waist.
    """
    q, T = ca.SX.sym("q", chain.n), ca.SX.sym("T", 16)
    options, shared = ca.SX.sym("options", len(ARM_OPTIONS)), ca.SX.sym("shared", len(SHARED_OPTIONS))
    R, p = ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3)
    T_base_wrist = ca.reshape(T, 4, 4).T
    # The arm stands still and the target moves the other way.
    p_target, R_target = R.T @ (T_base_wrist[:3, 3] - p), R.T @ T_base_wrist[:3, :3]
    position, rotation, elbow = ca.vertsplit(options[:3])
    regularization, smoothness, hyperextension, enough, _ = ca.vertsplit(shared)
    upper_arm = chain.upper_arm
    beyond = hyperextension + HINTED_HYPEREXTENSION * elbow
    problem = ArmProblem(
        q_last=q,
        p_target=p_target,
        quaternion_target=quaternion_of(R_target),
        weights=ca.vertcat(position, rotation, regularization, smoothness, elbow, beyond, enough),
        p_elbow_target=chain.shoulder + upper_arm * (R.T @ options[3:]),
    )
    return ca.Function(f"{chain.side}_problem", [q, T, options, shared, R, p], [problem.join()], {"cse": True})


def step_of(H: list[list[ca.SX]], least: ca.SX, arguments: list[ca.SX], limits: tuple[np.ndarray, np.ndarray]) -> list:
    """Newton step and safety for a Hessian, given (q, gradient, curvature, damping, problem) and limits."""
    q, gradient, _, damping, _ = arguments
    step, smallest_pivot = solve_on_free_joints(H, q, gradient, damping, *limits)
    return [step, smallest_pivot - MIN_PIVOT * least]


def _remeasured(chain: ArmChain, objective: Objective) -> ca.Function:
    report, q, problem = ca.MX.sym("report", 5), ca.MX.sym("q", chain.n), ca.MX.sym("p", ArmProblem.size(chain.n))
    _, value, _, _, measures = objective.evaluate(q, problem)
    return ca.Function(f"{chain.side}_remeasured", [report, q, problem], [ca.vertcat(value, measures[4:], report[3:])])


def _evaluation(chain: ArmChain) -> ca.Function:
    n = chain.n
    q, problem = ca.SX.sym("q", n), ca.SX.sym("problem", ArmProblem.size(n))
    arm_problem = ArmProblem.split(problem, n)
    cost = arm_cost(chain, q, arm_problem)
    gradient = ca.vertcat(*cost.gradient)
    projected = q - ca.fmin(ca.fmax(q - gradient, chain.lower), chain.upper)
    measures = ca.vertcat(ca.norm_inf(projected), *_errors(cost, arm_problem), cost.position_error, cost.rotation_error)
    outputs = [q, cost.value, gradient, cost.geometry.join(), measures]
    return ca.Function(f"{chain.side}_evaluation", [q, problem], outputs, {"cse": True})


def _errors(cost: ArmCost, problem: ArmProblem) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Error part of the cost, whether the exact Hessian is wanted, and whether the error is small enough to stop.

    What it has beyond its convex part grows with the errors. It is wanted where that part is small beside the curvature
    that is always there, because then it is safe, and where the errors are large, because then it is needed.
    """
    position, rotation, regularization, smoothness, _, _, enough = ca.vertsplit(problem.weights)
    error = position * cost.position_error**2 + rotation * cost.rotation_error**2
    beyond = ARM_LENGTH * position * cost.position_error + rotation * cost.rotation_error
    wanted = ca.logic_and(enough == 0.0, ca.logic_or(beyond < regularization + smoothness, error > LARGE_ERROR))
    return error, wanted, error <= enough


def _step(chain: ArmChain, exact: bool) -> ca.Function:
    n = chain.n
    sizes = {"q": n, "gradient": n, "geometry": Geometry.size(chain), "damping": 1, "problem": ArmProblem.size(n)}
    symbols = arguments = [ca.SX.sym(key, size) for key, size in sizes.items()]
    weights = ArmProblem.split(arguments[-1], n).weights
    geometry = Geometry.split(arguments[2], chain)
    H = arm_hessian(chain, geometry, weights, exact)
    if not exact:
        error = weights[0] * ca.sumsqr(geometry.e) + weights[1] * geometry.angle**2
        arguments = [
            *arguments[:3],
            arguments[3] + ca.if_else(weights[6] > 0.0, ERROR_DAMPING * error, 0.0),
            arguments[4],
        ]
    outputs = step_of(H, weights[2] + weights[3], arguments, (chain.lower, chain.upper))
    return ca.Function(f"{chain.side}_{'exact' if exact else 'convex'}_step", symbols, outputs, {"cse": True})
