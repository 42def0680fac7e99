"""`Gauge`: it says of a solver's joints what the solver says, and of any others what Pinocchio says."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from ik_proto import Collision, SolveRequest
from ik_service.engine import Engine
from ik_service.solver import Solver


@pytest.mark.parametrize("collision", ["off", "report", "avoid"])
def test_it_agrees_with_the_solver(
    engine: Engine, solver: Solver, solve_request: Callable[[int], SolveRequest], collision: Collision
) -> None:
    gauge = engine.gauge.copy()
    for seed in range(10):
        request, waist = solve_request(seed), np.array([0.02, -0.01, 0.03]) * seed
        targets = request.left_wrist, request.right_wrist
        solution = solver.solve(*targets, request.q, collision=collision, waist=waist)
        measured = gauge.measure(*targets, solution.q, collision, waist)
        np.testing.assert_allclose(measured.position_error, solution.position_error, atol=1e-12)
        np.testing.assert_allclose(measured.rotation_error, solution.rotation_error, atol=1e-7)
        np.testing.assert_allclose(measured.tau, solution.tau, atol=1e-12)
        assert measured.clearance == pytest.approx(solution.clearance, abs=1e-12)
        assert measured.nearest == solution.nearest


def test_it_measures_what_is_there_whatever_that_is(engine: Engine) -> None:
    """Joints beyond the limits, hands through the body: nothing is moved, though collisions are to be avoided."""
    robot, rng = engine.robot, np.random.default_rng(5)
    deepest = math.inf
    for _ in range(20):
        q = rng.uniform(robot.lower - 0.3, robot.upper + 0.3)
        left, right = robot.fk(q)
        measured = engine.gauge.measure(left, right, q, "avoid")
        np.testing.assert_allclose(measured.position_error, 0.0, atol=1e-9)
        np.testing.assert_allclose(measured.tau, robot.gravity_torque(q), atol=1e-9)
        assert measured.clearance == engine.gauge.measure(np.eye(4), np.eye(4), q, "report").clearance
        deepest = min(deepest, measured.clearance)
    assert deepest < -0.02


def test_nothing_is_measured_that_is_not_asked_for(engine: Engine) -> None:
    measured = engine.gauge.measure(np.eye(4), np.eye(4), np.zeros(14), "off")
    assert (measured.clearance, measured.nearest) == (math.inf, None)
