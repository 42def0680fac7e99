"""The solver against Ipopt on the shared workloads, and what it promises for any request."""

import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.workloads import Workload, cold, tracking, unreachable
from ik_proto import Status
from ik_proto.robots import load_description
from ik_service import descent as descent_module
from ik_service import solver as solver_module
from ik_service.kernel import Kernel, load_kernel
from ik_service.objective import Preset
from ik_service.reference import Reference
from ik_service.robot import Robot
from ik_service.solver import Solution, Solver

CostOf = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float]

TIGHT = {"max_iter": 500, "tol": 1e-10, "print_level": 0, "bound_relax_factor": 0.0}


@pytest.fixture(scope="module")
def ipopt(robot: Robot, preset: Preset) -> Reference:
    """The seeds' formulation, solved as tightly as Ipopt can, without its usual relaxation of the limits."""
    return Reference(robot, preset, TIGHT)


@pytest.fixture(scope="module", params=["vm", "c"])
def any_solver(request: pytest.FixtureRequest, robot: Robot) -> Solver:
    return Solver(robot, request.getfixturevalue(f"{request.param}_kernel"))


def _excess(solver: Solver, ipopt: Reference, cost_of: CostOf, robot: Robot, workload: Workload) -> np.ndarray:
    """Relative excess of our cost over Ipopt's from the same start; neither solver computes the costs."""
    excess, q = [], workload.first
    for k in range(len(workload)):
        start = workload.start(k, q)
        left, right = workload.left[k], workload.right[k]
        ours = solver.solve(left, right, start)
        theirs, _, converged = ipopt.solve(left, right, start)
        assert converged
        assert ours.status in (Status.OK, Status.UNREACHABLE)
        assert (robot.lower <= ours.q).all()
        assert (ours.q <= robot.upper).all()
        cost = cost_of(left, right, start, ours.q)
        best = cost_of(left, right, start, np.clip(theirs, robot.lower, robot.upper))
        excess.append((cost - best) / best)
        q = ours.q
    return np.array(excess)


def test_tracking_is_as_good_as_ipopt(any_solver: Solver, ipopt: Reference, cost_of: CostOf, robot: Robot) -> None:
    assert _excess(any_solver, ipopt, cost_of, robot, tracking(robot, 200)).max() <= 1e-8


def test_out_of_reach_is_as_good_as_ipopt(any_solver: Solver, ipopt: Reference, cost_of: CostOf, robot: Robot) -> None:
    assert _excess(any_solver, ipopt, cost_of, robot, unreachable(robot, 100)).max() <= 1e-6


def test_cold_solves_are_as_good_as_ipopt(any_solver: Solver, ipopt: Reference, cost_of: CostOf, robot: Robot) -> None:
    excess = _excess(any_solver, ipopt, cost_of, robot, cold(robot, 100))
    assert np.mean(excess > 0.01) <= 0.02


def test_without_other_starts_cold_solves_are_not(
    ipopt: Reference, cost_of: CostOf, robot: Robot, vm_kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Negative control: the comparison above can tell."""
    monkeypatch.setattr(solver_module, "JUMP", np.inf)
    excess = _excess(Solver(robot, vm_kernel), ipopt, cost_of, robot, cold(robot, 50))
    assert np.mean(excess > 0.01) > 0.1


def test_status_tells_reached_from_out_of_reach(any_solver: Solver, robot: Robot) -> None:
    for workload, expected in ((tracking(robot, 300), Status.OK), (unreachable(robot, 100), Status.UNREACHABLE)):
        q = workload.first
        for left, right in zip(workload.left, workload.right, strict=True):
            solution = any_solver.solve(left, right, q)
            assert solution.status is expected
            q = solution.q


def test_reachable_targets_nearby_count_as_reached(any_solver: Solver, robot: Robot) -> None:
    rng = np.random.default_rng(6)
    middle, half = (robot.lower + robot.upper) / 2.0, (robot.upper - robot.lower) / 2.0
    for _ in range(200):
        q = rng.uniform(middle - 0.8 * half, middle + 0.8 * half)
        start = np.clip(q + rng.uniform(-0.5, 0.5, robot.nq), robot.lower, robot.upper)
        assert any_solver.solve(*robot.fk(q), start).status is Status.OK


def test_steady_streams_never_look_elsewhere(robot: Robot, vm_kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """In reach and out of it, a smooth path of targets is followed by one descent a frame, so it is not torn."""
    usual, followed = Solver(robot, vm_kernel), []
    for workload in (tracking(robot, 300), unreachable(robot, 300)):
        q = workload.first
        for left, right in zip(workload.left, workload.right, strict=True):
            followed.append((left, right, q, usual.solve(left, right, q)))
            q = followed[-1][-1].q
    monkeypatch.setattr(solver_module, "JUMP", np.inf)
    plain = Solver(robot, vm_kernel)
    for left, right, q, solution in followed:
        same = plain.solve(left, right, q)
        assert np.array_equal(same.q, solution.q)
        assert same.iterations == solution.iterations


rotation_vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)
positions = st.tuples(*[st.floats(-100.0, 100.0)] * 3).map(np.array) | st.tuples(*[st.floats(-0.6, 0.6)] * 3).map(
    np.array
)


@st.composite
def poses(draw: st.DrawFn) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = pin.exp3(draw(rotation_vectors)), draw(positions)
    return T


@given(poses(), poses(), st.lists(st.floats(-20.0, 20.0), min_size=14, max_size=14).map(np.array))
@settings(deadline=None, max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_valid_request_gets_a_true_answer(
    any_solver: Solver, robot: Robot, cost_of: CostOf, left: np.ndarray, right: np.ndarray, q: np.ndarray
) -> None:
    """Finite, within the limits, no worse than the start, and its errors, cost and torques are those of its q."""
    solution = any_solver.solve(left, right, q)
    _check_truth(solution, robot, left, right)
    assert solution.status in (Status.OK, Status.UNREACHABLE)
    assert (robot.lower <= solution.q).all()
    assert (solution.q <= robot.upper).all()
    cost = cost_of(left, right, q, solution.q)
    assert solution.objective == pytest.approx(cost, rel=1e-7, abs=1e-9)
    at_start = cost_of(left, right, q, np.clip(q, robot.lower, robot.upper))
    assert cost <= at_start * (1.0 + 1e-7) + 1e-9


def _check_truth(solution: Solution, robot: Robot, left: np.ndarray, right: np.ndarray) -> None:
    assert np.allclose(solution.tau, robot.gravity_torque(solution.q), rtol=0.0, atol=1e-10)  # [N m]
    for side, (wrist, target) in enumerate(zip(robot.fk(solution.q), (left, right), strict=True)):
        distance = np.linalg.norm(wrist[:3, 3] - target[:3, 3])
        assert solution.position_error[side] == pytest.approx(distance, rel=1e-9, abs=1e-9)
        # |R - R_target| = 2 sqrt(2) sin(angle / 2) holds at every angle, half a turn included.
        chord = np.linalg.norm(wrist[:3, :3] - target[:3, :3])
        angle = solution.rotation_error[side]
        assert 2.0 * np.sqrt(2.0) * np.sin(angle / 2.0) == pytest.approx(chord, abs=1e-7)


@pytest.mark.parametrize("axis", [*np.eye(3), np.ones(3) / np.sqrt(3.0)])
@pytest.mark.parametrize("distance", [0.0, 0.3, 100.0])
def test_exactly_half_a_turn_away(any_solver: Solver, robot: Robot, axis: np.ndarray, distance: float) -> None:
    for q in (np.zeros(robot.nq), robot.upper, (robot.lower + robot.upper) / 2.0):
        targets = []
        for wrist in robot.fk(q):
            target = wrist.copy()
            target[:3, :3] = (2.0 * np.outer(axis, axis) - np.eye(3)) @ wrist[:3, :3]
            target[0, 3] += distance
            targets.append(target)
        solution = any_solver.solve(targets[0], targets[1], q)
        assert solution.status in (Status.OK, Status.UNREACHABLE)
        _check_truth(solution, robot, targets[0], targets[1])


def test_target_at_the_wrist_with_no_pull_moves_nothing(any_solver: Solver, robot: Robot) -> None:
    q = np.zeros(robot.nq)
    solution = any_solver.solve(*robot.fk(q), q)
    assert np.array_equal(solution.q, q)
    assert solution.status is Status.OK
    assert solution.iterations == 0


def test_answer_depends_on_the_request_alone(robot: Robot, vm_kernel: Kernel) -> None:
    used, workload = Solver(robot, vm_kernel), cold(robot, 20)
    requests = [(workload.left[k], workload.right[k], workload.start(k, workload.first)) for k in range(20)]
    for left, right, q in requests:
        used.solve(left, right, q)
    for left, right, q in requests:
        fresh, again = Solver(robot, vm_kernel).solve(left, right, q), used.solve(left, right, q)
        assert np.array_equal(fresh.q, again.q)
        assert fresh.iterations == again.iterations


def test_solutions_belong_to_the_caller(solver: Solver, robot: Robot) -> None:
    workload = cold(robot, 2)
    first = solver.solve(workload.left[0], workload.right[0], workload.first)
    kept = [array.copy() for array in (first.q, first.position_error, first.rotation_error, first.tau)]
    request = workload.first.copy()
    solver.solve(workload.left[1], workload.right[1], request)
    assert np.array_equal(request, workload.first)
    now = (first.q, first.position_error, first.rotation_error, first.tau)
    assert all(np.array_equal(a, b) for a, b in zip(now, kept, strict=True))


def test_the_arms_do_not_know_of_each_other(solver: Solver, robot: Robot) -> None:
    workload = cold(robot, 10)
    for k in range(1, 10):
        start = workload.start(k, workload.first).copy()
        both = solver.solve(workload.left[k], workload.right[k], start)
        start[7:] = workload.first[7:]
        other = solver.solve(workload.left[k], workload.right[0], start)
        assert np.array_equal(both.q[:7], other.q[:7])


def test_solvers_of_one_kernel_run_in_threads(robot: Robot, any_solver: Solver) -> None:
    workload = tracking(robot, 200)
    answers: dict[int, list[np.ndarray]] = {}

    def run(name: int) -> None:
        mine = Solver(robot, any_solver.kernel)
        answers[name] = [
            mine.solve(left, right, workload.first).q for left, right in zip(workload.left, workload.right, strict=True)
        ]

    threads = [threading.Thread(target=run, args=(name,)) for name in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
    assert len(answers) == 4
    assert all(np.array_equal(answers[0], other) for other in answers.values())


def test_not_converged_echoes_the_request(
    robot: Robot, preset: Preset, cost_of: CostOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With one iteration allowed, a far target cannot be solved; the answer is the request's q, limits or not."""
    monkeypatch.setattr(descent_module, "ITERATIONS", 1)
    monkeypatch.setattr(descent_module, "BLOCK", 1)
    monkeypatch.setattr(solver_module, "MAX_CALLS", 1)
    workload = cold(robot, 3)
    hurried = Solver(robot, load_kernel(robot, preset, compiled=False))
    q = workload.first + 3.0
    left, right = workload.left[0], workload.right[0]
    solution = hurried.solve(left, right, q)
    assert solution.status is Status.NOT_CONVERGED
    assert np.array_equal(solution.q, q)
    assert solution.q is not q
    _check_truth(solution, robot, left, right)
    assert solution.objective == pytest.approx(cost_of(left, right, q, q), rel=1e-9)


def test_more_calls_rescue_a_short_kernel(
    robot: Robot, preset: Preset, vm_kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where one call of the kernel is not enough, it is continued, and ends where a longer one does."""
    workload = tracking(robot, 50)
    monkeypatch.setattr(descent_module, "ITERATIONS", 1)
    monkeypatch.setattr(descent_module, "BLOCK", 1)
    monkeypatch.setattr(solver_module, "MAX_CALLS", 10)
    short, whole = Solver(robot, load_kernel(robot, preset, compiled=False)), Solver(robot, vm_kernel)
    for left, right in zip(workload.left, workload.right, strict=True):
        a, b = short.solve(left, right, workload.first), whole.solve(left, right, workload.first)
        assert a.status is b.status
        assert np.allclose(a.q, b.q, atol=1e-6)


def test_arms_of_other_lengths(make_robot: Callable[..., Path]) -> None:
    description = load_description(make_robot())
    robot = Robot.load(description)
    solver = Solver(robot, load_kernel(robot, Preset.of(description, "openwbt"), compiled=False))
    rng = np.random.default_rng(2)
    for _ in range(20):
        q = rng.uniform(0.8 * robot.lower, 0.8 * robot.upper)
        start = q + rng.normal(0.0, 0.05, robot.nq)
        solution = solver.solve(*robot.fk(q), start)
        assert solution.q.shape == (9,)
        assert (robot.lower <= solution.q).all()
        assert (solution.q <= robot.upper).all()
        assert solution.status is not Status.NOT_CONVERGED
