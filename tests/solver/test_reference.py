"""The yardstick measures what it should: the seeds' cost, with their options."""

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.workloads import cold, tracking
from ik_service.preset import Preset
from ik_service.reference import SEED_OPTIONS, Reference
from ik_service.robot import Robot

CostOf = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float]


@pytest.fixture(scope="module")
def reference(robot: Robot, preset: Preset) -> Reference:
    return Reference(robot, preset)


def test_options_are_the_seeds() -> None:
    assert dict(SEED_OPTIONS) == {"max_iter": 50, "tol": 1e-6, "print_level": 0}


def test_objective_is_the_seeds_cost(reference: Reference, robot: Robot, cost_of: CostOf) -> None:
    workload = cold(robot, 30)
    for k in range(len(workload)):
        left, right, q_last = workload.left[k], workload.right[k], workload.start(k, workload.first)
        q = np.random.default_rng(k).uniform(robot.lower, robot.upper)
        found = float(reference.objective(q, q_last, left, right))
        assert found == pytest.approx(cost_of(left, right, q_last, q), rel=1e-9)


def test_solution_is_a_minimum_within_the_limits(reference: Reference, robot: Robot, cost_of: CostOf) -> None:
    rng, workload = np.random.default_rng(1), tracking(robot, 10)
    for left, right in zip(workload.left, workload.right, strict=True):
        q, objective, converged = reference.solve(left, right, workload.first)
        assert converged
        assert (robot.lower - 1e-7 <= q).all()  # Ipopt relaxes bounds by 1e-8 of their size
        assert (q <= robot.upper + 1e-7).all()
        assert objective == pytest.approx(cost_of(left, right, workload.first, q), rel=1e-9)
        for _ in range(20):
            near = np.clip(q + rng.normal(0.0, 1e-3, robot.nq), robot.lower, robot.upper)
            assert cost_of(left, right, workload.first, near) >= objective - 1e-9


def test_non_convergence_is_told(robot: Robot, preset: Preset) -> None:
    hurried = Reference(robot, preset, {**SEED_OPTIONS, "max_iter": 1})
    workload = cold(robot, 1)
    q, _, converged = hurried.solve(workload.left[0], workload.right[0], workload.first)
    assert not converged
    assert np.isfinite(q).all()
