"""Preset `openwbt` against Ipopt on the shared workloads: the same cost, solved as well."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from truth import check_truth, poses

from benchmarks.workloads import Workload, cold, tracking, unreachable
from ik_proto import Status
from ik_service import solver as solver_module
from ik_service.kernel import Kernel
from ik_service.preset import Preset
from ik_service.reference import Reference
from ik_service.robot import Robot
from ik_service.solver import Solver

CostOf = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float]

TIGHT = {"max_iter": 500, "tol": 1e-10, "print_level": 0, "bound_relax_factor": 0.0}


@pytest.fixture(scope="module")
def ipopt(robot: Robot, preset: Preset) -> Reference:
    """The seeds' formulation, solved as tightly as Ipopt can, without its usual relaxation of the limits."""
    return Reference(robot, preset, TIGHT)


@pytest.fixture(scope="module", params=["vm", "c"])
def any_solver(request: pytest.FixtureRequest, robot: Robot, preset: Preset) -> Solver:
    return Solver(robot, request.getfixturevalue(f"{request.param}_kernel"), preset)


def _excess(solver: Solver, ipopt: Reference, cost_of: CostOf, robot: Robot, workload: Workload) -> np.ndarray:
    """Relative excess of our cost over Ipopt's from the same start; neither solver computes the costs."""
    excess, q = [], workload.first
    for k in range(len(workload)):
        start = workload.start(k, q)
        left, right = workload.left[k], workload.right[k]
        ours = solver.solve(left, right, start, collision="off")
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
    ipopt: Reference, cost_of: CostOf, robot: Robot, solver: Solver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Negative control: the comparison above can tell."""
    monkeypatch.setattr(solver_module, "JUMP", np.inf)
    excess = _excess(solver, ipopt, cost_of, robot, cold(robot, 50))
    assert np.mean(excess > 0.01) > 0.1


def test_status_tells_reached_from_out_of_reach(any_solver: Solver, robot: Robot) -> None:
    for workload, expected in ((tracking(robot, 300), Status.OK), (unreachable(robot, 100), Status.UNREACHABLE)):
        q = workload.first
        for left, right in zip(workload.left, workload.right, strict=True):
            solution = any_solver.solve(left, right, q, collision="off")
            assert solution.status is expected
            q = solution.q


def test_reachable_targets_nearby_count_as_reached(any_solver: Solver, robot: Robot) -> None:
    rng = np.random.default_rng(6)
    middle, half = (robot.lower + robot.upper) / 2.0, (robot.upper - robot.lower) / 2.0
    for _ in range(200):
        q = rng.uniform(middle - 0.8 * half, middle + 0.8 * half)
        start = np.clip(q + rng.uniform(-0.5, 0.5, robot.nq), robot.lower, robot.upper)
        assert any_solver.solve(*robot.fk(q), start, collision="off").status is Status.OK


def test_steady_streams_never_look_elsewhere(
    robot: Robot, kernel: Kernel, preset: Preset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In reach and out of it, a smooth path of targets is followed by one descent a frame, so it is not torn."""
    usual, followed = Solver(robot, kernel, preset), []
    for workload in (tracking(robot, 300), unreachable(robot, 300)):
        q = workload.first
        for left, right in zip(workload.left, workload.right, strict=True):
            followed.append((left, right, q, usual.solve(left, right, q, collision="off")))
            q = followed[-1][-1].q
    monkeypatch.setattr(solver_module, "JUMP", np.inf)
    plain = Solver(robot, kernel, preset)
    for left, right, q, solution in followed:
        same = plain.solve(left, right, q, collision="off")
        assert np.array_equal(same.q, solution.q)
        assert same.iterations == solution.iterations
        assert (solution.start, solution.starts) == (0, 1)


@given(poses(), poses(), st.lists(st.floats(-20.0, 20.0), min_size=14, max_size=14).map(np.array))
@settings(max_examples=200)
def test_any_openwbt_request_gets_the_cost_it_names(
    any_solver: Solver, robot: Robot, cost_of: CostOf, left: np.ndarray, right: np.ndarray, q: np.ndarray
) -> None:
    """And a cost no worse than the start's.

    Of targets tens of metres away the descent may be cut short by the rounding of a cost of 1e5: then it says so.
    """
    solution = any_solver.solve(left, right, q, collision="off")
    check_truth(solution, robot, left, right)
    furthest = max(np.linalg.norm(T[:3, 3]) for T in (left, right))
    assert solution.status in (Status.OK, Status.UNREACHABLE) or furthest > 20.0
    if solution.status is Status.NOT_CONVERGED:
        return
    cost = cost_of(left, right, q, solution.q)
    assert solution.objective == pytest.approx(cost, rel=1e-7, abs=1e-9)
    at_start = cost_of(left, right, q, np.clip(q, robot.lower, robot.upper))
    assert cost <= at_start * (1.0 + 1e-7) + 1e-9
