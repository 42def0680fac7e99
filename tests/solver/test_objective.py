"""The closed-form derivatives against automatic differentiation, finite differences and a second cost."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from ik_proto.robots import RobotDescription, load_description
from ik_service.chains import ArmChain
from ik_service.objective import LOST, MISSED, WEIGHTS, ArmProblem, Geometry, arm_cost, arm_hessian
from ik_service.robot import Robot

OPENWBT = np.array([50.0, 1.0, 0.02, 0.1, 0.0, 0.0, 0.0])
EVERYTHING = np.array([50.0, 1.0, 0.02, 0.1, 3.0, 0.7, 0.0])
"""Every term of the cost, in the order of `WEIGHTS`."""


@dataclass(frozen=True)
class Request:
    """One problem of an arm, in numbers."""

    q: np.ndarray
    q_last: np.ndarray
    target: np.ndarray
    weights: np.ndarray
    p_elbow: np.ndarray

    def vector(self) -> np.ndarray:
        x, y, z, w = pin.Quaternion(self.target[:3, :3]).coeffs()
        return np.concatenate((self.q_last, self.target[:3, 3], [w, x, y, z], self.weights, self.p_elbow))

    def at(self, q: np.ndarray) -> "Request":
        return Request(q, self.q_last, self.target, self.weights, self.p_elbow)

    def weighted(self, weights: np.ndarray) -> "Request":
        return Request(self.q, self.q_last, self.target, weights, self.p_elbow)


@dataclass(frozen=True)
class Numbers:
    """Derivatives at one point, closed-form and by automatic differentiation."""

    value: float
    gradient: np.ndarray
    hessian: np.ndarray
    convex: np.ndarray
    ad_gradient: np.ndarray
    ad_hessian: np.ndarray


Evaluate = Callable[[Request], Numbers]


def _matrix(rows: list[list[ca.SX]]) -> ca.SX:
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


def _evaluator(arm: ArmChain) -> Evaluate:
    q, vector = ca.SX.sym("q", arm.n), ca.SX.sym("problem", ArmProblem.size(arm.n))
    problem = ArmProblem.split(vector, arm.n)
    cost = arm_cost(arm, q, problem)
    ad_hessian, ad_gradient = ca.hessian(cost.value, q)
    # Through the vector, as the solver does it.
    geometry = Geometry.split(cost.geometry.join(), arm)
    exact, convex = (_matrix(arm_hessian(arm, geometry, problem.weights, exact)) for exact in (True, False))
    outputs = [cost.value, ca.vertcat(*cost.gradient), exact, convex, ad_gradient, ad_hessian]
    function = ca.Function("cost", [q, vector], outputs)

    def evaluate(request: Request) -> Numbers:
        value, gradient, hessian, convex, ad_gradient, ad_hessian = (
            np.array(result) for result in function(request.q, request.vector())
        )
        return Numbers(float(value[0, 0]), gradient.ravel(), hessian, convex, ad_gradient.ravel(), ad_hessian)

    return evaluate


def _problems(arm: ArmChain, count: int = 40, weights: np.ndarray = EVERYTHING) -> list[Request]:
    """Random problems, the targets anything from near the wrist to half a turn and a metre away."""
    rng = np.random.default_rng(11)
    problems = []
    for i in range(count):
        q, q_last = rng.uniform(arm.lower, arm.upper, (2, arm.n))
        axis, direction = rng.normal(size=(2, 3))
        angle = (1e-9, 1e-4, 0.5, 2.0, 3.0, np.pi - 1e-4)[i % 6]
        target = arm.wrist(q)
        target[:3, :3] = pin.exp3(angle * axis / np.linalg.norm(axis)) @ target[:3, :3]
        target[:3, 3] += rng.normal(0.0, (1e-6, 0.05, 1.0)[i % 3], 3)
        p_elbow = arm.shoulder + arm.upper_arm * direction / np.linalg.norm(direction)
        problems.append(Request(q, q_last, target, weights, p_elbow))
    return problems


@pytest.fixture(params=["left", "right"])
def arm(request: pytest.FixtureRequest, robot: Robot) -> ArmChain:
    return robot.arms[("left", "right").index(request.param)]


@pytest.fixture
def evaluate(arm: ArmChain) -> Evaluate:
    return _evaluator(arm)


def test_problems_have_elbows_on_both_sides_of_straight(arm: ArmChain) -> None:
    """Else the derivatives of the hyperextension term would be tested where it is zero."""
    assert arm.elbow is not None
    angle, side = arm.straight_elbow
    beyond = [side * (problem.q[arm.elbow] - angle) > 0.0 for problem in _problems(arm)]
    assert 5 < sum(beyond) < 35


def test_derivatives_agree_with_automatic_differentiation(arm: ArmChain, evaluate: Evaluate) -> None:
    for problem in _problems(arm):
        found = evaluate(problem)
        scale = 1.0 + np.abs(found.ad_hessian).max()
        assert np.allclose(found.gradient, found.ad_gradient, atol=1e-10 * scale)
        # The automatic Hessian loses digits near w = 0 and near half a turn, the closed form does not.
        assert np.allclose(found.hessian, found.ad_hessian, atol=1e-6 * scale)


def test_derivatives_agree_with_finite_differences(arm: ArmChain, evaluate: Evaluate) -> None:
    """Away from the cut at half a turn, where the angle has a kink."""
    step = 1e-5
    for problem in (problem for i, problem in enumerate(_problems(arm)) if i % 6 != 5):
        found = evaluate(problem)
        for i, offset in enumerate(step * np.eye(arm.n)):
            ahead, behind = (evaluate(problem.at(problem.q + sign * offset)) for sign in (1.0, -1.0))
            scale = 1.0 + np.abs(found.hessian).max()
            assert abs((ahead.value - behind.value) / (2 * step) - found.gradient[i]) < 1e-6 * scale
            column = (ahead.gradient - behind.gradient) / (2 * step)
            assert np.allclose(column, found.hessian[:, i], atol=1e-6 * scale)


@pytest.mark.parametrize("term", ["elbow", "hyperextension"])
def test_term_is_felt_in_value_gradient_and_hessian(arm: ArmChain, evaluate: Evaluate, term: str) -> None:
    """Negative control: leaving the term out of a derivative would show in the comparisons above."""
    without = EVERYTHING.copy()
    without[WEIGHTS.index(term)] = 0.0
    felt = np.zeros(3, dtype=int)
    for problem in _problems(arm):
        full, less = evaluate(problem), evaluate(problem.weighted(without))
        scale = 1.0 + np.abs(full.ad_hessian).max()
        felt += [
            full.value - less.value > 1e-4,
            np.abs(full.gradient - less.gradient).max() > 1e-10 * scale,
            np.abs(full.hessian - less.hessian).max() > 1e-6 * scale,
        ]
    assert (felt > 5).all()


def test_elbow_term_is_the_squared_distance_of_pinocchios_elbow(robot: Robot, description: RobotDescription) -> None:
    model = pin.buildModelFromMJCF(str(description.model))
    data, weight = model.createData(), EVERYTHING[WEIGHTS.index("elbow")]
    without = EVERYTHING.copy()
    without[WEIGHTS.index("elbow")] = 0.0
    for arm in robot.arms:
        evaluate = _evaluator(arm)
        assert arm.elbow is not None
        for problem in _problems(arm, 10):
            configuration = np.zeros(model.nq)
            for name, angle in zip(arm.joint_names, problem.q, strict=True):
                configuration[model.joints[model.getJointId(name)].idx_q] = angle
            pin.framesForwardKinematics(model, data, configuration)
            T_world_base = data.oMf[model.getFrameId(description.base)]
            p_elbow = (T_world_base.inverse() * data.oMi[model.getJointId(arm.joint_names[arm.elbow])]).translation
            found = evaluate(problem).value - evaluate(problem.weighted(without)).value
            assert found == pytest.approx(weight * np.sum((p_elbow - problem.p_elbow) ** 2), rel=1e-8)


def test_hyperextension_counts_beyond_the_straight_arm_only(arm: ArmChain, evaluate: Evaluate) -> None:
    """Zero up to `straight_elbow`, then the square of what is beyond; the arm is longest 0.1 rad later."""
    assert arm.elbow is not None
    angle, side = arm.straight_elbow
    without = EVERYTHING.copy()
    without[WEIGHTS.index("hyperextension")] = 0.0
    (problem,) = _problems(arm, 1)
    lengths = {}
    for beyond in (-1.0, -0.1, 0.0, 0.05, 0.1, 0.15, 0.4):
        q = problem.q.copy()
        q[arm.elbow] = angle + side * beyond
        term = evaluate(problem.at(q)).value - evaluate(problem.at(q).weighted(without)).value
        assert term == pytest.approx(0.7 * max(beyond, 0.0) ** 2, abs=1e-9)
        straight = np.zeros(arm.n)
        straight[arm.elbow] = q[arm.elbow]
        lengths[beyond] = np.linalg.norm(arm.wrist(straight)[:3, 3] - arm.shoulder)
    assert max(lengths, key=lambda beyond: lengths[beyond]) == 0.1


def test_hessian_is_symmetric_and_its_convex_part_positive_definite(arm: ArmChain, evaluate: Evaluate) -> None:
    least = 2.0 * (0.02 + 0.1)  # regularization and smoothness
    indefinite = 0
    for problem in _problems(arm):
        found = evaluate(problem)
        assert np.array_equal(found.hessian, found.hessian.T)
        assert np.linalg.eigvalsh(found.convex).min() > least * (1.0 - 1e-6)
        indefinite += bool(np.linalg.eigvalsh(found.hessian).min() < 0.0)
    assert indefinite > 0  # else there would be no need for the convex part


def test_convex_part_is_not_the_hessian(arm: ArmChain, evaluate: Evaluate) -> None:
    """Negative control: the comparisons above can tell the exact Hessian from the Gauss-Newton one."""
    found = evaluate(_problems(arm)[2])
    assert not np.allclose(found.convex, found.ad_hessian, atol=1e-2 * np.abs(found.ad_hessian).max())


def test_value_is_the_seeds_cost(
    robot: Robot, cost_of: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float]
) -> None:
    rng = np.random.default_rng(5)
    evaluators = [_evaluator(arm) for arm in robot.arms]
    for _ in range(50):
        q, q_last, q_target = rng.uniform(robot.lower, robot.upper, (3, robot.nq))
        targets = robot.fk(q_target)
        found = 0.0
        for evaluate, part, target in zip(evaluators, (slice(0, 7), slice(7, 14)), targets, strict=True):
            found += evaluate(Request(q[part], q_last[part], target, OPENWBT, np.zeros(3))).value
        assert found == pytest.approx(cost_of(*targets, q_last, q), rel=1e-9)


def test_arms_of_any_length(make_robot: Callable[..., Path]) -> None:
    """Without an elbow, whose terms are then absent."""
    for arm in Robot.load(load_description(make_robot())).arms:
        evaluate = _evaluator(arm)
        for problem in _problems(arm, 6):
            found = evaluate(problem)
            scale = 1.0 + np.abs(found.ad_hessian).max()
            assert np.allclose(found.hessian, found.ad_hessian, atol=1e-6 * scale)
            assert found.value == evaluate(problem.weighted(OPENWBT)).value


def test_problem_survives_its_vector(arm: ArmChain) -> None:
    vector = ca.SX.sym("problem", ArmProblem.size(arm.n))
    assert ca.is_equal(ArmProblem.split(vector, arm.n).join(), vector)


@pytest.mark.parametrize(
    ("error", "counted"), [(0.0, 0.0), (MISSED, 0.0), (0.3, 0.3 - MISSED), (2.0 * LOST, LOST), (1e9, LOST)]
)
def test_slowing_raises_smoothness_alone(arm: ArmChain, error: float, counted: float) -> None:
    (problem,) = _problems(arm, 1)
    before, after = problem.vector(), problem.weighted(EVERYTHING + 8.0 * counted * (np.arange(7) == 3)).vector()
    slower = ArmProblem.slowed(ca.MX(ca.DM(before)), arm.n, ca.MX(8.0), ca.MX(error))
    assert np.allclose(np.array(ca.evalf(slower)).ravel(), after, rtol=0.0, atol=1e-12)
