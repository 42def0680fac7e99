"""Mode `reach`: global solves from start after start, and the starts they come from."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from body_oracle import CapsuleOracle
from truth import check_clearance, check_truth, posed

from ik_proto import Status
from ik_service.kernel import Kernel
from ik_service.robot import Robot
from ik_service.seeds import COUNT, Seeds, spread
from ik_service.solver import Collision, Solver

POSITION = 0.1e-3
ROTATION = np.radians(0.1)
BUDGET = 128
Clear = Callable[[int, int], np.ndarray]
INSIDE_THE_CHEST = posed(np.zeros(3), np.array([0.0, 0.0, 0.15]))


@pytest.mark.parametrize("waist", [None, np.array([0.4, -0.1, 0.2])])
def test_reachable_clear_targets_are_met_from_anywhere(
    robot: Robot,
    precise_solver: Solver,
    oracle: CapsuleOracle,
    clear_postures: Clear,
    waist: np.ndarray | None,
) -> None:
    """From random starts, which may be clear or not: the answer is on target, within the limits and clear."""
    rng, tracked, margin = np.random.default_rng(1), 0, robot.collision.margin
    for goal in clear_postures(1, 400):
        if waist is not None and oracle.clearance(goal, waist) < margin:
            continue
        targets, start = robot.fk(goal, waist), rng.uniform(robot.lower, robot.upper)
        solution = precise_solver.solve(*targets, start, mode="reach", waist=waist, starts=BUDGET)
        check_truth(solution, robot, *targets, waist)
        check_clearance(solution, oracle, "avoid", waist)
        assert solution.status is Status.OK
        assert solution.position_error.max() <= POSITION
        assert solution.rotation_error.max() <= ROTATION
        assert oracle.clearance(solution.q, waist) >= margin - 1e-9
        assert 0 <= solution.start <= solution.starts <= BUDGET
        tracked += precise_solver.solve(*targets, start, waist=waist).status is Status.OK
    assert tracked < 200  # negative control: one descent from the same starts does not get there


def test_answers_are_clear_because_it_is_asked_for(
    robot: Robot, precise_solver: Solver, oracle: CapsuleOracle, clear_postures: Clear
) -> None:
    """Negative control: with `report` some of the same answers are not clear, and are told as they are."""
    rng, touching = np.random.default_rng(2), 0
    for goal in clear_postures(2, 100):
        start = rng.uniform(robot.lower, robot.upper)
        solution = precise_solver.solve(*robot.fk(goal), start, mode="reach", collision="report")
        assert solution.status is Status.OK
        check_clearance(solution, oracle, "report")
        touching += solution.clearance < robot.collision.margin
    assert touching > 5


def test_a_start_on_target_wins(robot: Robot, precise_solver: Solver, clear_postures: Clear) -> None:
    for q in clear_postures(3, 30):
        solution = precise_solver.solve(*robot.fk(q), q, mode="reach")
        assert (solution.start, solution.starts) == (0, 1)
        assert np.abs(solution.q - q).max() < 1e-3


def test_budget_is_kept(robot: Robot, precise_solver: Solver) -> None:
    """A target that cannot be met spends it all and no more."""
    q = np.zeros(robot.nq)
    for starts in (1, 2, 7, 64, 256):
        solution = precise_solver.solve(INSIDE_THE_CHEST, INSIDE_THE_CHEST, q, mode="reach", starts=starts)
        assert solution.starts == starts
        assert solution.start <= starts
        assert solution.status in (Status.UNREACHABLE, Status.BLOCKED)


def test_more_starts_solve_more(robot: Robot, precise_solver: Solver, clear_postures: Clear) -> None:
    rng = np.random.default_rng(4)
    requests = [(*robot.fk(goal), rng.uniform(robot.lower, robot.upper)) for goal in clear_postures(4, 100)]
    solved = []
    for starts in (1, 4, 64):
        answers = [precise_solver.solve(*request, mode="reach", starts=starts) for request in requests]
        assert max(answer.starts for answer in answers) <= starts
        solved.append(sum(answer.status is Status.OK for answer in answers))
    assert solved[0] < solved[1] <= solved[2] == 100


@pytest.mark.parametrize("collision", ["off", "avoid"])
def test_reach_is_deterministic(
    robot: Robot, kernel: Kernel, precise_solver: Solver, clear_postures: Clear, collision: Collision
) -> None:
    """Same request, same answer: from another solver, after other work, with tables made anew."""
    tables = (Seeds(robot.arms[0]), Seeds(robot.arms[1]))
    other = Solver(robot, replace(kernel, seeds=tables), precise_solver.preset)
    rng = np.random.default_rng(5)
    requests = [(*robot.fk(goal), rng.uniform(robot.lower, robot.upper)) for goal in clear_postures(5, 30)]
    first = [precise_solver.solve(*request, mode="reach", collision=collision) for request in requests]
    for request, answer in reversed(list(zip(requests, first, strict=True))):
        again = other.solve(*request, mode="reach", collision=collision)
        assert np.array_equal(again.q, answer.q)
        assert (again.start, again.starts, again.iterations) == (answer.start, answer.starts, answer.iterations)


@pytest.mark.parametrize("collision", ["off", "avoid"])
@pytest.mark.parametrize("preset_name", ["solver", "precise_solver"])
def test_unreachable_targets_get_the_best_effort(
    robot: Robot,
    request: pytest.FixtureRequest,
    oracle: CapsuleOracle,
    clear_postures: Clear,
    collision: Collision,
    preset_name: str,
) -> None:
    """One arm's target a metre beyond its reach: the other still arrives, and more starts never make it worse."""
    solver: Solver = request.getfixturevalue(preset_name)
    for goal, start in zip(clear_postures(6, 12), clear_postures(7, 12), strict=True):
        left, right = robot.fk(goal)
        ray = left[:3, 3] - robot.arms[0].shoulder
        left[:3, 3] += ray / np.linalg.norm(ray)
        costs = []
        for starts in (1, 8, BUDGET):
            solution = solver.solve(left, right, start, mode="reach", collision=collision, starts=starts)
            check_truth(solution, robot, left, right)
            check_clearance(solution, oracle, collision)
            assert solution.status is Status.UNREACHABLE
            if collision == "avoid":
                assert solution.clearance >= robot.collision.margin - 1e-9
            position, rotation = robot.wrist_errors(solution.q, left, right)
            costs.append(50.0 * position @ position + rotation @ rotation)
        assert costs[0] * (1.0 + 1e-9) >= costs[1] >= costs[2] * (1.0 - 1e-9)
        nearest = np.linalg.norm(left[:3, 3] - robot.arms[0].shoulder) - robot.arms[0].reach
        assert nearest - 1e-3 <= solution.position_error[0] <= nearest + 0.15
        assert solution.position_error[1] <= 5.0 * POSITION


def test_with_nothing_clear_in_reach_the_answer_is_no_worse_than_the_start(
    robot: Robot, precise_solver: Solver, oracle: CapsuleOracle
) -> None:
    """Both hands inside the chest, from starts in penetration: no pair comes nearer than it was or than the margin."""
    rng, tried = np.random.default_rng(8), 0
    while tried < 20:
        q = rng.uniform(robot.lower, robot.upper)
        if oracle.clearance(q) >= 0.0:
            continue
        tried += 1
        solution = precise_solver.solve(INSIDE_THE_CHEST, INSIDE_THE_CHEST, q, mode="reach", starts=8)
        before, after = oracle.distances(q), oracle.distances(solution.q)
        assert (after >= np.minimum(before, robot.collision.margin) - 1e-9).all()
        assert solution.status in (Status.UNREACHABLE, Status.BLOCKED)


def test_postures_cover_the_joint_range_evenly(robot: Robot) -> None:
    for arm in robot.arms:
        postures = spread(arm, COUNT)
        assert postures.shape == (COUNT, arm.n)
        assert (postures > arm.lower).all()
        assert (postures < arm.upper).all()
        share = (postures - arm.lower) / (arm.upper - arm.lower)
        # Each tenth of the middle 80 % of every joint's range gets its share.
        for column in share.T:
            counts, _ = np.histogram(column, bins=8, range=(0.1, 0.9))
            assert counts.sum() == COUNT
            assert np.abs(counts - COUNT / 8).max() <= 0.1 * COUNT / 8
        assert np.abs(np.corrcoef(share.T) - np.eye(arm.n)).max() < 0.1
        assert np.array_equal(postures[:10], spread(arm, 10))
