"""What the solver promises for any request, in every preset, mode and setting."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from body_oracle import CapsuleOracle
from hypothesis import given, settings
from hypothesis import strategies as st
from truth import check_clearance, check_truth, near_positions, posed, poses, rotation_vectors

from benchmarks.workloads import cold, tracking
from ik_proto import Status
from ik_proto.robots import load_description
from ik_service import dual_arm as dual_arm_module
from ik_service import newton as newton_module
from ik_service import solver as solver_module
from ik_service.kernel import Kernel, load_kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solver import Collision, Mode, Solver

CostOf = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float]

SETTINGS: tuple[Collision, ...] = ("off", "report", "avoid")


@pytest.fixture(scope="module", params=["vm", "c"])
def any_solver(request: pytest.FixtureRequest, robot: Robot, preset: Preset) -> Solver:
    return Solver(robot, request.getfixturevalue(f"{request.param}_kernel"), preset)


@pytest.fixture(scope="module")
def solvers(robot: Robot, kernel: Kernel, preset: Preset, precise: Preset) -> dict[str, Solver]:
    return {each.name: Solver(robot, kernel, each) for each in (preset, precise)}


def test_limits_are_met_to_the_last_bit(any_solver: Solver, robot: Robot) -> None:
    """A target pulls every joint over each of its limits in turn; the answer sits on the very same float64."""
    touched: set[tuple[str, str]] = set()
    for i in range(robot.nq):
        for side, bound, beyond in (("lower", robot.lower, -0.3), ("upper", robot.upper, 0.3)):
            q = (robot.lower + robot.upper) / 2.0
            q[i] = bound[i] + beyond
            solution = any_solver.solve(*robot.fk(q), q, collision="off")
            assert (robot.lower <= solution.q).all()
            assert (solution.q <= robot.upper).all()
            if solution.q[i] == bound[i]:
                touched.add((robot.joint_names[i], side))
    assert len(touched) == 2 * robot.nq


unit = st.floats(0.0, 1.0)
elbows = st.tuples(rotation_vectors.filter(lambda v: np.linalg.norm(v) > 1e-3), unit).map(
    lambda hint: np.array([*hint[0] / np.linalg.norm(hint[0]), hint[1]])
)
hints = st.fixed_dictionaries(
    {},
    optional={
        "waist": st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array),
        "left_elbow": elbows,
        "right_elbow": elbows,
        "weights": st.tuples(*[unit] * 4).map(lambda weights: np.array(weights).reshape(2, 2)),
    },
)
starts = st.lists(st.floats(-0.2, 1.2), min_size=14, max_size=14).map(np.array)


@given(
    left=poses(),
    right=poses(),
    share=starts,
    hints=hints,
    name=st.sampled_from(["openwbt", "precise"]),
    mode=st.sampled_from(["track", "reach"]),
    collision=st.sampled_from(SETTINGS),
)
@settings(max_examples=300)
def test_any_request_gets_a_true_answer(
    solvers: dict[str, Solver],
    robot: Robot,
    oracle: CapsuleOracle,
    left: np.ndarray,
    right: np.ndarray,
    share: np.ndarray,
    hints: dict[str, np.ndarray],
    name: str,
    mode: Mode,
    collision: Collision,
) -> None:
    """In every preset, mode and setting, with any hints, from starts in and out of the limits."""
    q = robot.lower + share * (robot.upper - robot.lower)
    before = q.copy()
    solution = solvers[name].solve(left, right, q, mode=mode, collision=collision, starts=4, **hints)
    check_truth(solution, robot, left, right, hints.get("waist"))
    check_clearance(solution, oracle, collision, hints.get("waist"))
    assert np.array_equal(q, before)
    assert solution.objective >= 0.0
    assert solution.status in (Status.OK, Status.UNREACHABLE, Status.BLOCKED)
    if collision != "avoid":
        assert solution.status is not Status.BLOCKED
    if mode == "reach":
        assert 0 <= solution.start <= solution.starts <= 4
    assert solution.iterations >= 0


@pytest.mark.parametrize("axis", [*np.eye(3), np.ones(3) / np.sqrt(3.0)])
@pytest.mark.parametrize("distance", [0.0, 0.3, 100.0])
@pytest.mark.parametrize("name", ["openwbt", "precise"])
def test_exactly_half_a_turn_away(
    solvers: dict[str, Solver], robot: Robot, axis: np.ndarray, distance: float, name: str
) -> None:
    for q in (np.zeros(robot.nq), robot.upper, (robot.lower + robot.upper) / 2.0):
        targets = []
        for wrist in robot.fk(q):
            target = wrist.copy()
            target[:3, :3] = (2.0 * np.outer(axis, axis) - np.eye(3)) @ wrist[:3, :3]
            target[0, 3] += distance
            targets.append(target)
        for collision in SETTINGS:
            solution = solvers[name].solve(targets[0], targets[1], q, collision=collision)
            assert solution.status.success
            check_truth(solution, robot, targets[0], targets[1])


@pytest.mark.parametrize("collision", SETTINGS)
@pytest.mark.parametrize("name", ["openwbt", "precise"])
def test_target_at_the_wrist_with_no_pull_moves_nothing(
    solvers: dict[str, Solver], robot: Robot, collision: Collision, name: str
) -> None:
    q = np.zeros(robot.nq)
    solution = solvers[name].solve(*robot.fk(q), q, collision=collision)
    assert np.array_equal(solution.q, q)
    assert solution.status is Status.OK
    assert solution.iterations == 0
    assert (solution.start, solution.starts) == (0, 1)


@pytest.mark.parametrize("mode", ["track", "reach"])
@pytest.mark.parametrize("name", ["openwbt", "precise"])
def test_answer_depends_on_the_request_alone(
    robot: Robot, kernel: Kernel, solvers: dict[str, Solver], mode: Mode, name: str
) -> None:
    """A solver that has just done everything else answers as a fresh one does."""
    used, workload, rng = solvers[name], cold(robot, 12), np.random.default_rng(0)
    full: dict[str, Any] = {"waist": rng.uniform(-0.3, 0.3, 3), "weights": np.full((2, 2), 0.5)}
    nothing: dict[str, Any] = {}
    full |= {f"{side}_elbow": np.array([0.0, 0.0, -1.0, 1.0]) for side in ("left", "right")}
    for k in range(len(workload)):
        request = (workload.left[k], workload.right[k], workload.start(k, workload.first))
        for collision in SETTINGS:
            for hints in (nothing, full):
                used.solve(*request, collision="avoid", mode="reach", starts=2, **full)
                used.solve(*request[::-1][1:], workload.first, collision="off", **(nothing if hints else full))
                fresh = Solver(robot, kernel, used.preset).solve(*request, collision=collision, mode=mode, **hints)
                again = used.solve(*request, collision=collision, mode=mode, **hints)
                assert np.array_equal(fresh.q, again.q)
                assert fresh.iterations == again.iterations
                assert (fresh.status, fresh.start, fresh.starts) == (again.status, again.start, again.starts)


def test_setting_is_read_by_value(solvers: dict[str, Solver], robot: Robot) -> None:
    """Names that arrive over the wire are equal to the literals, not the same objects."""
    left = posed(np.zeros(3), np.array([0.0, 0.0, 0.15]))
    request = (left, robot.fk(np.zeros(robot.nq))[1], np.zeros(robot.nq))
    for collision in SETTINGS:
        copied: Collision = "".join(collision)  # type: ignore[assignment]  # ty: ignore[invalid-assignment]
        for other in SETTINGS:
            expected = solvers["precise"].solve(*request, collision=collision)
            solvers["precise"].solve(*request, collision=other)
            found = solvers["precise"].solve(*request, collision=copied)
            assert np.array_equal(found.q, expected.q)
            assert found.clearance == expected.clearance


@pytest.mark.parametrize("mode", ["track", "reach"])
@pytest.mark.parametrize("name", ["openwbt", "precise"])
def test_solutions_belong_to_the_caller(solvers: dict[str, Solver], robot: Robot, mode: Mode, name: str) -> None:
    workload, solver = cold(robot, 3), solvers[name]
    first = solver.solve(workload.left[0], workload.right[0], workload.first, mode=mode)
    kept = [array.copy() for array in (first.q, first.position_error, first.rotation_error, first.tau)]
    request = workload.first.copy()
    for k in (1, 2):
        solver.solve(workload.left[k], workload.right[k], request, mode=mode)
    assert np.array_equal(request, workload.first)
    now = (first.q, first.position_error, first.rotation_error, first.tau)
    assert all(np.array_equal(a, b) for a, b in zip(now, kept, strict=True))


@pytest.mark.parametrize("name", ["openwbt", "precise"])
def test_the_arms_do_not_know_of_each_other(solvers: dict[str, Solver], robot: Robot, name: str) -> None:
    """As long as collisions are not avoided."""
    workload, solver = cold(robot, 10), solvers[name]
    for k in range(1, 10):
        start = workload.start(k, workload.first).copy()
        both = solver.solve(workload.left[k], workload.right[k], start, collision="report")
        start[7:] = workload.first[7:]
        other = solver.solve(workload.left[k], workload.right[0], start, collision="report")
        assert np.array_equal(both.q[:7], other.q[:7])


@pytest.mark.parametrize("mode", ["track", "reach"])
def test_solvers_of_one_kernel_run_in_threads(robot: Robot, kernel: Kernel, precise: Preset, mode: Mode) -> None:
    workload = tracking(robot, 60)
    requests = [*zip(workload.left, workload.right, strict=True)]
    answers: dict[int, list[np.ndarray]] = {}

    def run(name: int) -> None:
        mine = Solver(robot, kernel, precise)
        answers[name] = [mine.solve(left, right, workload.first, mode=mode).q for left, right in requests]

    threads = [threading.Thread(target=run, args=(name,)) for name in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
    run(4)
    assert len(answers) == 5
    assert all(np.array_equal(answers[4], other) for other in answers.values())


def test_not_converged_echoes_the_request(
    robot: Robot,
    preset: Preset,
    cost_of: CostOf,
    oracle: CapsuleOracle,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With one iteration allowed, a far target cannot be solved; the answer is the request's q, limits or not."""
    monkeypatch.setattr(newton_module, "FIRST", 0)
    monkeypatch.setattr(dual_arm_module, "BLOCKS", ())
    hurried = Solver(robot, load_kernel(robot, compiled=False), preset)
    workload = cold(robot, 3)
    q = workload.first + 3.0
    left, right = workload.left[0], workload.right[0]
    monkeypatch.setattr(solver_module, "JUMP", np.inf)  # no other starts either
    for collision in ("off", "report"):
        solution = hurried.solve(left, right, q, collision=collision)
        assert solution.status is Status.NOT_CONVERGED
        assert np.array_equal(solution.q, q)
        assert solution.q is not q
        check_truth(solution, robot, left, right)
        check_clearance(solution, oracle, collision)
        assert solution.objective == pytest.approx(cost_of(left, right, q, q), rel=1e-9)
    batch = hurried.solve_batch(left[None], right[None], q[None], collision="off")
    assert batch.statuses == [Status.NOT_CONVERGED]
    assert np.array_equal(batch.q[0], q)


def test_arms_of_other_lengths(small_robot: Robot, small_kernel: Kernel, make_robot: Callable[..., Path]) -> None:
    """And without capsules: avoidance has nothing to do, and nothing is measured."""
    preset = Preset.of(load_description(make_robot()), "openwbt")
    robot, solver = small_robot, Solver(small_robot, small_kernel, preset)
    rng = np.random.default_rng(2)
    for k in range(24):
        q = rng.uniform(0.8 * robot.lower, 0.8 * robot.upper)
        start = q + rng.normal(0.0, 0.05, robot.nq)
        mode: Mode = "reach" if k % 2 else "track"
        solution = solver.solve(*robot.fk(q), start, mode=mode, collision=SETTINGS[k % 3])
        assert solution.q.shape == (9,)
        check_truth(solution, robot, *robot.fk(q))
        assert solution.status is Status.OK
        assert (solution.clearance, solution.nearest) == (np.inf, None)
        if mode == "reach":
            assert solution.position_error.max() < 1e-4


@given(near_positions, rotation_vectors)
@settings(max_examples=20)
def test_targets_may_be_views(solvers: dict[str, Solver], robot: Robot, p: np.ndarray, w: np.ndarray) -> None:
    """Rows of a batch, transposes, other layouts in memory: only the numbers count."""
    T, q = posed(w, p), np.zeros(robot.nq)
    expected = solvers["precise"].solve(T, T, q).q
    strided = np.zeros((8, 8))[::2, ::2]
    strided[:] = T
    for same in (np.asfortranarray(T), strided):
        assert np.array_equal(solvers["precise"].solve(same, same, q).q, expected)
