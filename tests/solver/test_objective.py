"""The closed-form derivatives against automatic differentiation, finite differences and a second cost."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from ik_proto.robots import RobotDescription, RobotError, load_description
from ik_service.objective import Preset, arm_convex_hessian, arm_cost
from ik_service.robot import ArmChain, Robot


@dataclass(frozen=True)
class Numbers:
    """Derivatives at one point, closed-form and by automatic differentiation."""

    value: float
    gradient: np.ndarray
    hessian: np.ndarray
    convex: np.ndarray
    ad_gradient: np.ndarray
    ad_hessian: np.ndarray


Evaluate = Callable[[np.ndarray, np.ndarray, np.ndarray], Numbers]


def _matrix(rows: list[list[ca.SX]]) -> ca.SX:
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


def _evaluator(arm: ArmChain, preset: Preset) -> Evaluate:
    """Evaluate at (q, q_last, T_target)."""
    n = len(arm.joint_names)
    q, q_last = ca.SX.sym("q", n), ca.SX.sym("q_last", n)
    p, quaternion = ca.SX.sym("p", 3), ca.SX.sym("quaternion", 4)
    cost = arm_cost(arm, preset, q, q_last, p, quaternion)
    ad_hessian, ad_gradient = ca.hessian(cost.value, q)
    convex = _matrix(arm_convex_hessian(arm, preset, q, quaternion))
    outputs = [cost.value, ca.vertcat(*cost.gradient), _matrix(cost.hessian), convex, ad_gradient, ad_hessian]
    function = ca.Function("cost", [q, q_last, p, quaternion], outputs)

    def evaluate(q: np.ndarray, q_last: np.ndarray, target: np.ndarray) -> Numbers:
        x, y, z, w = pin.Quaternion(target[:3, :3]).coeffs()
        value, gradient, hessian, convex, ad_gradient, ad_hessian = (
            np.array(result) for result in function(q, q_last, target[:3, 3], np.array([w, x, y, z]))
        )
        return Numbers(float(value[0, 0]), gradient.ravel(), hessian, convex, ad_gradient.ravel(), ad_hessian)

    return evaluate


def _problems(arm: ArmChain, count: int = 40) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Random (q, q_last, T_target), the targets anything from near the wrist to half a turn and a metre away."""
    rng = np.random.default_rng(11)
    problems = []
    for i in range(count):
        q, q_last = rng.uniform(arm.lower, arm.upper, (2, len(arm.lower)))
        axis = rng.normal(size=3)
        angle = (1e-9, 1e-4, 0.5, 2.0, 3.0, np.pi - 1e-4)[i % 6]
        target = arm.wrist(q)
        target[:3, :3] = pin.exp3(angle * axis / np.linalg.norm(axis)) @ target[:3, :3]
        target[:3, 3] += rng.normal(0.0, (1e-6, 0.05, 1.0)[i % 3], 3)
        problems.append((q, q_last, target))
    return problems


@pytest.fixture(params=["left", "right"])
def arm(request: pytest.FixtureRequest, robot: Robot) -> ArmChain:
    return robot.arms[("left", "right").index(request.param)]


def test_derivatives_agree_with_automatic_differentiation(arm: ArmChain, preset: Preset) -> None:
    evaluate = _evaluator(arm, preset)
    for problem in _problems(arm):
        found = evaluate(*problem)
        scale = 1.0 + np.abs(found.ad_hessian).max()
        assert np.allclose(found.gradient, found.ad_gradient, atol=1e-10 * scale)
        # The automatic Hessian loses digits near w = 0 and near half a turn, the closed form does not.
        assert np.allclose(found.hessian, found.ad_hessian, atol=1e-6 * scale)


def test_derivatives_agree_with_finite_differences(arm: ArmChain, preset: Preset) -> None:
    """Away from the cut at half a turn, where the angle has a kink."""
    evaluate, step = _evaluator(arm, preset), 1e-5
    for q, q_last, target in (problem for i, problem in enumerate(_problems(arm)) if i % 6 != 5):
        found = evaluate(q, q_last, target)
        for i, offset in enumerate(step * np.eye(len(q))):
            ahead, behind = evaluate(q + offset, q_last, target), evaluate(q - offset, q_last, target)
            scale = 1.0 + np.abs(found.hessian).max()
            assert abs((ahead.value - behind.value) / (2 * step) - found.gradient[i]) < 1e-6 * scale
            column = (ahead.gradient - behind.gradient) / (2 * step)
            assert np.allclose(column, found.hessian[:, i], atol=1e-6 * scale)


def test_hessian_is_symmetric_and_its_convex_part_positive_definite(arm: ArmChain, preset: Preset) -> None:
    least = 2.0 * (preset.regularization + preset.smoothness)
    indefinite = 0
    for problem in _problems(arm):
        found = _evaluator(arm, preset)(*problem)
        assert np.array_equal(found.hessian, found.hessian.T)
        assert np.linalg.eigvalsh(found.convex).min() > least * (1.0 - 1e-6)
        indefinite += bool(np.linalg.eigvalsh(found.hessian).min() < 0.0)
    assert indefinite > 0  # else there would be no need for the convex part


def test_convex_part_is_not_the_hessian(arm: ArmChain, preset: Preset) -> None:
    """Negative control: the comparisons above can tell the exact Hessian from the Gauss-Newton one."""
    found = _evaluator(arm, preset)(*_problems(arm)[2])
    assert not np.allclose(found.convex, found.ad_hessian, atol=1e-2 * np.abs(found.ad_hessian).max())


def test_value_is_the_seeds_cost(
    robot: Robot, preset: Preset, cost_of: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float]
) -> None:
    rng = np.random.default_rng(5)
    left, right = (_evaluator(arm, preset) for arm in robot.arms)
    for _ in range(50):
        q, q_last, q_target = rng.uniform(robot.lower, robot.upper, (3, robot.nq))
        targets = robot.fk(q_target)
        found = left(q[:7], q_last[:7], targets[0]).value + right(q[7:], q_last[7:], targets[1]).value
        assert found == pytest.approx(cost_of(*targets, q_last, q), rel=1e-9)


def test_arms_of_any_length(make_robot: Callable[..., Path]) -> None:
    description = load_description(make_robot())
    robot, preset = Robot.load(description), Preset.of(description, "openwbt")
    for arm in robot.arms:
        evaluate = _evaluator(arm, preset)
        for problem in _problems(arm, 6):
            found = evaluate(*problem)
            scale = 1.0 + np.abs(found.ad_hessian).max()
            assert np.allclose(found.hessian, found.ad_hessian, atol=1e-6 * scale)


def test_openwbt_preset_has_the_seeds_weights(preset: Preset) -> None:
    weights = (preset.position, preset.rotation, preset.regularization, preset.smoothness)
    assert weights == (50.0, 1.0, 0.02, 0.1)


@pytest.mark.parametrize(
    ("weights", "words"),
    [
        ({"position": 1.0, "rotation": 1.0, "regularization": 1.0}, "needs smoothness"),
        ({"position": -1.0, "rotation": 1.0, "regularization": 1.0, "smoothness": 1.0}, "needs position"),
        ({"position": 1.0, "rotation": 1.0, "regularization": 0.0, "smoothness": 0.0}, "above zero"),
        (
            {"position": 1.0, "rotation": 1.0, "regularization": 1.0, "smoothness": 1.0, "elbow": 1.0},
            "has no use for elbow",
        ),
    ],
)
def test_wrong_preset_is_one_line(description: RobotDescription, weights: dict[str, float], words: str) -> None:
    with pytest.raises(RobotError, match=words) as caught:
        Preset.of(replace(description, presets={"mine": weights}), "mine")
    assert "\n" not in str(caught.value)


def test_unknown_preset_lists_the_known(description: RobotDescription) -> None:
    with pytest.raises(RobotError, match="no preset fast; it has openwbt"):
        Preset.of(description, "fast")
