"""A batch is its rows solved one by one, to the last bit."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.workloads import cold
from ik_proto import Status
from ik_proto.robots import load_description
from ik_service.kernel import ROWS, Kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solution import BatchSolution, Solution
from ik_service.solver import Collision, Mode, Solver

Rows = dict[str, np.ndarray]


def _requests(robot: Robot, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Near targets, far ones and some out of reach, from starts in and out of the limits."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(robot.lower - 0.1, robot.upper + 0.1, (count, robot.nq))
    far = rng.uniform(robot.lower, robot.upper, (count, robot.nq))
    goals = np.where(np.arange(count)[:, None] % 3 == 0, far, np.clip(q + rng.normal(0.0, 0.1, q.shape), -3.0, 3.0))
    wrists = [robot.fk(goal) for goal in goals]
    left, right = (np.array(side) for side in zip(*wrists, strict=True))
    left[::5, 0, 3] += 0.5
    return left, right, q


def _hints(robot: Robot, count: int) -> Rows:
    rng = np.random.default_rng(1)

    def elbows() -> np.ndarray:
        directions = rng.normal(size=(count, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return np.hstack((directions, rng.uniform(0.0, 1.0, (count, 1))))

    weights = rng.uniform(0.0, 1.0, (count, 2, 2))
    weights[::4] = np.round(weights[::4])  # some of them 0 or 1
    return {
        "waist": rng.uniform(-0.4, 0.4, (count, len(robot.waist.joint_names))),
        "left_elbow": elbows(),
        "right_elbow": elbows(),
        "weights": weights,
    }


def _compare(batch: BatchSolution, singles: list[Solution]) -> None:
    one_by_one = BatchSolution.of(singles)
    for name in ("q", "tau", "position_error", "rotation_error", "objective", "clearance", "start"):
        assert np.array_equal(getattr(batch, name), getattr(one_by_one, name)), name
    assert batch.statuses == one_by_one.statuses
    assert batch.start.dtype == one_by_one.start.dtype


def _both(
    solver: Solver, requests: tuple[np.ndarray, np.ndarray, np.ndarray], mode: Mode, collision: Collision, hints: Rows
) -> tuple[BatchSolution, list[Solution]]:
    batch = solver.solve_batch(*requests, mode=mode, collision=collision, starts=6, **hints)
    singles = []
    for k, request in enumerate(zip(*requests, strict=True)):
        row = {name: rows[k] for name, rows in hints.items()}
        singles.append(solver.solve(*request, mode=mode, collision=collision, starts=6, **row))
    return batch, singles


@pytest.fixture(scope="module")
def solvers(robot: Robot, kernel: Kernel, preset: Preset, precise: Preset) -> dict[str, Solver]:
    return {each.name: Solver(robot, kernel, each) for each in (preset, precise)}


@pytest.mark.parametrize("hinted", [False, True])
@pytest.mark.parametrize("mode", ["track", "reach"])
@pytest.mark.parametrize("collision", ["off", "report", "avoid"])
@pytest.mark.parametrize("name", ["openwbt", "precise"])
def test_rows_are_single_solves(
    robot: Robot, solvers: dict[str, Solver], name: str, collision: Collision, mode: Mode, hinted: bool
) -> None:
    count = ROWS + 13
    hints = _hints(robot, count) if hinted else {}
    batch, singles = _both(solvers[name], _requests(robot, count), mode, collision, hints)
    _compare(batch, singles)
    assert batch.q.shape == (count, robot.nq)
    statuses = set(batch.statuses)
    assert len(statuses) > 1  # rows of all kinds
    if mode == "track":
        assert (Status.BLOCKED in statuses) == (collision == "avoid")


@pytest.mark.parametrize("count", [1, 2, ROWS - 1, ROWS, ROWS + 1, 3 * ROWS - 1])
def test_any_number_of_rows(robot: Robot, solvers: dict[str, Solver], count: int) -> None:
    """Whatever stands beside a row, and whoever solves it: the answers do not depend on how rows are packed."""
    batch, singles = _both(solvers["precise"], _requests(robot, count), "track", "avoid", {})
    _compare(batch, singles)


@pytest.mark.parametrize("missing", ["waist", "left_elbow", "right_elbow", "weights"])
def test_hints_may_be_left_out_one_by_one(robot: Robot, solvers: dict[str, Solver], missing: str) -> None:
    hints = _hints(robot, 9)
    del hints[missing]
    _compare(*_both(solvers["precise"], _requests(robot, 9), "track", "avoid", hints))


def test_every_row_counts_its_iterations(robot: Robot, solvers: dict[str, Solver]) -> None:
    batch, singles = _both(solvers["precise"], _requests(robot, 40), "track", "avoid", {})
    assert batch.iterations == sum(solution.iterations for solution in singles)


def test_openwbt_restarts_rows_that_jump(
    robot: Robot, solvers: dict[str, Solver], preset: Preset, kernel: Kernel
) -> None:
    workload = cold(robot, 40)
    assert workload.starts is not None
    requests = (workload.left, workload.right, workload.starts)
    batch, singles = _both(solvers["openwbt"], requests, "track", "off", {})
    _compare(batch, singles)
    assert (batch.start > 0).sum() > 5
    # Negative control: without restarts the same rows end elsewhere.
    plain = Solver(robot, kernel, replace(preset, restarts=0)).solve_batch(*requests, collision="off")
    assert not np.array_equal(plain.q[batch.start > 0], batch.q[batch.start > 0])


def test_answers_belong_to_the_caller(robot: Robot, solvers: dict[str, Solver]) -> None:
    requests = _requests(robot, 5)
    kept_requests = [array.copy() for array in requests]
    first = solvers["precise"].solve_batch(*requests)
    kept = first.q.copy(), first.tau.copy(), first.position_error.copy(), first.clearance.copy()
    solvers["precise"].solve_batch(*_requests(robot, 5, seed=9))
    now = first.q, first.tau, first.position_error, first.clearance
    assert all(np.array_equal(a, b) for a, b in zip(now, kept, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(requests, kept_requests, strict=True))
    first.q[:] = 0.0  # and may be written to
    first.clearance[:] = 0.0


def test_robot_without_capsules_or_waist(
    small_robot: Robot, small_kernel: Kernel, make_robot: Callable[..., Path]
) -> None:
    solver = Solver(small_robot, small_kernel, Preset.of(load_description(make_robot()), "openwbt"))
    batch, singles = _both(solver, _requests(small_robot, 7), "track", "avoid", {})
    _compare(batch, singles)
    assert (batch.clearance == np.inf).all()
