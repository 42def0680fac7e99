"""One descent of one arm: where it ends, that it never rises, that it keeps the limits, that it can be continued."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_service import descent as descent_module
from ik_service.descent import ITERATIONS, REPORT, TOLERANCE, descent
from ik_service.kernel import Kernel
from ik_service.objective import Preset
from ik_service.robot import ArmChain, Robot

Answer = tuple[np.ndarray, dict[str, float]]


def _run(
    function: ca.Function, start: np.ndarray, target: np.ndarray, q_last: np.ndarray, damping: float = 0.0
) -> Answer:
    q, report, _ = (np.array(result).ravel() for result in function(start, target, q_last, damping))
    return q, dict(zip(REPORT, report.tolist(), strict=True))


def _random_problem(arm: ArmChain, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """An unrelated start and target, the start up to half a radian outside the limits."""
    rng = np.random.default_rng(seed)
    return rng.uniform(arm.lower - 0.5, arm.upper + 0.5), arm.wrist(rng.uniform(arm.lower, arm.upper))


@pytest.fixture(scope="module")
def left(robot: Robot) -> ArmChain:
    return robot.arms[0]


@pytest.fixture(scope="module")
def one_by_one(left: ArmChain, preset: Preset) -> ca.Function:
    """The same descent, one iteration a call."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(descent_module, "ITERATIONS", 1)
        patch.setattr(descent_module, "BLOCK", 1)
        return descent(left, preset, "one_by_one")


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=200)
def test_ends_at_a_stationary_point_within_the_limits(robot: Robot, vm_kernel: Kernel, seed: int) -> None:
    for arm, function in zip(robot.arms, vm_kernel.descents, strict=True):
        start, target = _random_problem(arm, seed)
        q, report = _run(function, start, target, start)
        assert (arm.lower <= q).all()
        assert (q <= arm.upper).all()
        assert np.isfinite(list(report.values())).all()
        again, report_again = _run(function, q, target, start, report["damping"])
        assert report_again["cost"] <= report["cost"] * (1.0 + 1e-12)
        if report["projected_gradient"] <= TOLERANCE:
            assert report_again["iterations"] == 0
            assert np.array_equal(again, q)
        else:
            assert report["iterations"] == ITERATIONS


def test_cost_never_rises_and_calls_continue_each_other(
    left: ArmChain, one_by_one: ca.Function, vm_kernel: Kernel
) -> None:
    for seed in range(20):
        start, target = _random_problem(left, seed)
        whole, whole_report = _run(vm_kernel.descents[0], start, target, start)
        q, damping, cost, calls = start, 0.0, np.inf, 0
        for _ in range(ITERATIONS):
            q, report = _run(one_by_one, q, target, start, damping)
            damping = report["damping"]
            assert report["cost"] <= cost * (1.0 + 1e-13)
            cost = report["cost"]
            calls += int(report["iterations"])
        assert calls == whole_report["iterations"]
        assert np.allclose(q, whole, atol=1e-9)


def test_limits_are_met_to_the_last_bit(robot: Robot, vm_kernel: Kernel, c_kernel: Kernel) -> None:
    """A target pulls every joint over each of its limits in turn; the answer sits on the very same float64."""
    touched: set[tuple[str, str]] = set()
    for kernel in (vm_kernel, c_kernel):
        for arm, function in zip(robot.arms, kernel.descents, strict=True):
            for i in range(len(arm.joint_names)):
                for side, bound in (("lower", arm.lower), ("upper", arm.upper)):
                    middle = (arm.lower + arm.upper) / 2.0
                    beyond = middle.copy()
                    beyond[i] = bound[i] + (0.3 if side == "upper" else -0.3)
                    q, _ = _run(function, beyond, arm.wrist(beyond), beyond)
                    assert (arm.lower <= q).all()
                    assert (q <= arm.upper).all()
                    if q[i] == bound[i]:
                        touched.add((arm.joint_names[i], side))
    assert len(touched) == 2 * robot.nq


def test_settles_far_targets_in_few_iterations(robot: Robot, vm_kernel: Kernel) -> None:
    """Gauss-Newton takes more than 20 on these; the exact Hessian is what makes the difference."""
    rng = np.random.default_rng(4)
    for arm, function in zip(robot.arms, vm_kernel.descents, strict=True):
        iterations = []
        for _ in range(50):
            q = rng.uniform(arm.lower, arm.upper)
            target = arm.wrist(q)
            target[:3, 3] = arm.shoulder + 1.3 * (target[:3, 3] - arm.shoulder)
            settled, _ = _run(function, q, target, q)
            nudged = target.copy()
            nudged[:3, 3] += rng.normal(0.0, 0.01, 3)
            _, report = _run(function, settled, nudged, settled)
            assert report["projected_gradient"] <= TOLERANCE
            iterations.append(report["iterations"])
        assert np.median(iterations) <= 4
