"""A bent waist: targets stay in the base frame, the shoulders move, and so does all that is fixed to the base."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from body_oracle import CapsuleOracle
from truth import check_clearance, check_truth

from ik_proto import Status
from ik_service.robot import Robot
from ik_service.solver import Mode, Solver

MODES: tuple[Mode, ...] = ("track", "reach")


def _waists(count: int) -> np.ndarray:
    return np.random.default_rng(1).uniform([-1.0, -0.4, -0.4], [1.0, 0.4, 0.4], (count, 3))


@pytest.mark.parametrize("mode", MODES)
def test_targets_are_met_in_the_base_frame(
    robot: Robot, precise_solver: Solver, clear_postures: Callable[[int, int], np.ndarray], mode: Mode
) -> None:
    """By Pinocchio's kinematics and torques of the whole robot with its waist bent."""
    rng = np.random.default_rng(2)
    for q, waist in zip(clear_postures(2, 40), _waists(40), strict=True):
        targets = robot.fk(q, waist)
        start = np.clip(q + rng.normal(0.0, 0.1, robot.nq), robot.lower, robot.upper)
        solution = precise_solver.solve(*targets, start, mode=mode, collision="off", waist=waist)
        check_truth(solution, robot, *targets, waist)
        assert solution.status is Status.OK
        position, rotation = robot.wrist_errors(solution.q, *targets, waist)
        assert position.max() <= 1e-3
        assert rotation.max() <= np.radians(1.0)
        # Negative control: the same joints with a straight waist are somewhere else.
        assert robot.wrist_errors(solution.q, *targets)[0].max() > 5e-3


@pytest.mark.parametrize("mode", MODES)
def test_answer_is_that_of_targets_turned_the_other_way(robot: Robot, precise_solver: Solver, mode: Mode) -> None:
    rng = np.random.default_rng(3)
    for waist in _waists(40):
        q = rng.uniform(robot.lower, robot.upper)
        start = np.clip(q + rng.normal(0.0, 0.2, robot.nq), robot.lower, robot.upper)
        targets = robot.fk(q, waist)
        back = np.linalg.inv(robot.waist.motion(waist))
        bent = precise_solver.solve(*targets, start, mode=mode, collision="off", waist=waist)
        straight = precise_solver.solve(*(back @ T for T in targets), start, mode=mode, collision="off")
        assert np.allclose(bent.q, straight.q, rtol=0.0, atol=1e-6)
        assert bent.status is straight.status
        assert np.allclose(bent.position_error, straight.position_error, rtol=0.0, atol=1e-7)
        assert np.abs(bent.tau - straight.tau).max() > 1e-3  # but gravity comes from elsewhere


@pytest.mark.parametrize("solver_name", ["solver", "precise_solver"])
def test_zeros_are_a_straight_waist(
    robot: Robot, request: pytest.FixtureRequest, solver_name: str, front: np.ndarray
) -> None:
    solver: Any = request.getfixturevalue(solver_name)
    targets = robot.fk(front + 0.1)
    a, b = (solver.solve(*targets, front, waist=waist) for waist in (None, np.zeros(3)))
    assert np.array_equal(a.q, b.q)
    assert np.array_equal(a.tau, b.tau)
    assert (a.clearance, a.nearest) == (b.clearance, b.nearest)


BEHIND = ("pelvis", "hips", "left_thigh", "right_thigh")
"""What a bent waist leaves behind."""


def test_capsules_of_torso_and_pelvis_are_where_they_belong(
    robot: Robot, precise_solver: Solver, oracle: CapsuleOracle
) -> None:
    """The torso goes with the arms, pelvis and thighs stay behind; by Pinocchio and coal."""
    rng, felt = np.random.default_rng(4), 0
    for k, waist in enumerate(_waists(60)):
        q = rng.uniform(robot.lower, robot.upper)
        while k % 3 == 0 and not any(name in BEHIND for name in oracle.nearest(q, waist)):
            q = rng.uniform(robot.lower, robot.upper)
        solution = precise_solver.solve(*robot.fk(q, waist), q, collision="report", waist=waist)
        check_clearance(solution, oracle, "report", waist)
        felt += abs(oracle.clearance(solution.q) - solution.clearance) > 1e-3
    assert felt >= 10  # negative control: with a straight waist the clearance would be another


def test_pelvis_that_comes_up_to_the_hands_is_avoided(
    robot: Robot, precise_solver: Solver, oracle: CapsuleOracle
) -> None:
    """Hands reach for the thighs of a robot that bows: straight, the way would be free."""
    rng, in_the_way = np.random.default_rng(5), 0
    margin = robot.collision.margin
    for _ in range(300):
        waist = np.array([0.0, 0.0, rng.uniform(0.2, 0.5)])
        start = rng.uniform(robot.lower, robot.upper)
        if oracle.clearance(start, waist) < margin:
            continue
        left, right = (T.copy() for T in robot.fk(start, waist))
        for T, side in ((left, 1.0), (right, -1.0)):
            T[:3, 3] = rng.normal([0.08, side * 0.12, -0.15], 0.05)
        solution = precise_solver.solve(left, right, start, waist=waist)
        assert oracle.clearance(solution.q, waist) >= margin - 1e-9
        ignorant = precise_solver.solve(left, right, start, collision="off", waist=waist)
        in_the_way += oracle.clearance(ignorant.q, waist) < 0.0
    assert in_the_way > 30
