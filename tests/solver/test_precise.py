"""Preset `precise` along paths: reachable means reached; beyond reach the arms neither chatter, freeze nor lurch."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
from body_oracle import CapsuleOracle

from benchmarks.workloads import tracking, unreachable
from ik_proto import Status
from ik_service.kernel import Kernel
from ik_service.preset import Preset
from ik_service.reference import Reference
from ik_service.robot import Robot
from ik_service.solver import Collision, Solution, Solver

POSITION_P99 = 0.5e-3
ROTATION_P99 = np.radians(0.3)
LARGEST_STEP_OUT_OF_REACH = 0.04  # [rad] a frame; undamped solvers step by 0.7 there
PERIOD = 0.02


@dataclass(frozen=True)
class Followed:
    """What came of following targets, each request starting from the answer before it.

    Attributes:
        q: Where it started, and the answers [rad], shape (N + 1, nq).
        position: Position error of each wrist [m], shape (N, 2).
        rotation: Rotation error of each wrist [rad], shape (N, 2).
        statuses: N of them.
    """

    q: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    statuses: list[Status]

    @property
    def steps(self) -> np.ndarray:
        """Largest joint displacement of each frame [rad], shape (N,)."""
        return np.abs(np.diff(self.q, axis=0)).max(1)


Targets = list[tuple[np.ndarray, np.ndarray]]


def _follow(solver: Solver, robot: Robot, targets: Targets, q: np.ndarray, collision: Collision) -> Followed:
    path, errors, statuses = [q], [], []
    for left, right in targets:
        solution = solver.solve(left, right, path[-1], collision=collision)
        path.append(solution.q)
        errors.append(robot.wrist_errors(solution.q, left, right))
        statuses.append(solution.status)
    position, rotation = (np.array(values) for values in zip(*errors, strict=True))
    return Followed(np.array(path), position, rotation, statuses)


def _smooth(seed: int, frames: int, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Joint positions that swing between limits on slow sinusoids, a few to each joint."""
    rng, t = np.random.default_rng(seed), np.arange(frames)[:, None] * PERIOD
    waves = sum(
        np.sin(2.0 * np.pi * (rng.uniform(0.03, 0.2, len(lower)) * t + rng.uniform(0.0, 1.0, len(lower))))
        for _ in range(4)
    )
    return (lower + upper) / 2.0 + (upper - lower) / 2.0 * waves / 4.0


def _bent(robot: Robot, share: float) -> tuple[np.ndarray, np.ndarray]:
    """The middle part of the joint limits, elbows short of straight, where both branches of solutions meet."""
    middle, half = (robot.lower + robot.upper) / 2.0, share * (robot.upper - robot.lower) / 2.0
    lower, upper = middle - half, middle + half
    elbows = [i for i, name in enumerate(robot.joint_names) if "elbow" in name]
    upper[elbows] = np.minimum(upper[elbows], 1.2)
    return lower, upper


def _wrists(robot: Robot, path: np.ndarray) -> Targets:
    return [robot.fk(q) for q in path]


@pytest.mark.parametrize("seed", range(4))
def test_reachable_paths_are_met(robot: Robot, precise_solver: Solver, seed: int) -> None:
    path = _smooth(seed, 400, *_bent(robot, 0.8))
    found = _follow(precise_solver, robot, _wrists(robot, path), path[0], "off")
    assert np.percentile(found.position, 99) <= POSITION_P99
    assert np.percentile(found.rotation, 99) <= ROTATION_P99
    assert set(found.statuses) == {Status.OK}


def test_reachable_paths_through_straight_elbows_are_met(robot: Robot, precise_solver: Solver) -> None:
    workload = tracking(robot, 500)
    targets = list(zip(workload.left, workload.right, strict=True))
    found = _follow(precise_solver, robot, targets, workload.first, "off")
    assert np.percentile(found.position, 99) <= POSITION_P99
    assert np.percentile(found.rotation, 99) <= ROTATION_P99


def test_openwbt_does_not_meet_them(robot: Robot, solver: Solver) -> None:
    """Negative control, and the reason for the preset."""
    path = _smooth(0, 400, *_bent(robot, 0.8))
    found = _follow(solver, robot, _wrists(robot, path), path[0], "off")
    assert np.percentile(found.position, 99) > 5.0 * POSITION_P99
    assert np.percentile(found.rotation, 99) > 5.0 * ROTATION_P99


@pytest.mark.parametrize("seed", range(4))
def test_clear_paths_are_met_with_avoidance_on(
    robot: Robot, precise_solver: Solver, oracle: CapsuleOracle, front: np.ndarray, seed: int
) -> None:
    """And by the very same answers, since nothing is in the way."""
    swing = 0.1 * (robot.upper - robot.lower)
    path = _smooth(seed, 300, np.maximum(front - swing, robot.lower), np.minimum(front + swing, robot.upper))
    assert min(oracle.clearance(q) for q in path) > 1.5 * robot.collision.margin
    targets = _wrists(robot, path)
    found = _follow(precise_solver, robot, targets, path[0], "avoid")
    assert np.percentile(found.position, 99) <= POSITION_P99
    assert np.percentile(found.rotation, 99) <= ROTATION_P99
    assert set(found.statuses) == {Status.OK}
    assert np.array_equal(found.q, _follow(precise_solver, robot, targets, path[0], "off").q)


@pytest.mark.parametrize("seed", range(8))
def test_smooth_paths_are_followed_without_flips(robot: Robot, precise_solver: Solver, seed: int) -> None:
    """The answers move hardly faster than the posture the targets were made from; a flip would be a leap."""
    path = _smooth(seed, 400, *_bent(robot, 0.8))
    found = _follow(precise_solver, robot, _wrists(robot, path), path[0], "off")
    assert found.steps.max() <= 2.0 * np.abs(np.diff(path, axis=0)).max()


def test_restarting_solver_would_flip(robot: Robot, precise_solver: Solver) -> None:
    """Negative control: global solves of the same path, each from an unrelated start, leap."""
    path, rng = _smooth(0, 30, *_bent(robot, 0.8)), np.random.default_rng(0)
    answers = [
        precise_solver.solve(*robot.fk(q), rng.uniform(robot.lower, robot.upper), mode="reach", collision="off").q
        for q in path
    ]
    assert np.abs(np.diff(answers, axis=0)).max() > 20.0 * np.abs(np.diff(path, axis=0)).max()


def test_out_of_reach_there_is_no_chatter(robot: Robot, kernel: Kernel, precise: Preset) -> None:
    workload = unreachable(robot)
    targets = list(zip(workload.left, workload.right, strict=True))
    found = _follow(Solver(robot, kernel, precise), robot, targets, workload.first, "off")
    assert set(found.statuses) == {Status.UNREACHABLE}
    assert found.steps.max() <= LARGEST_STEP_OUT_OF_REACH
    # Negative control: without what slows it, the same cost chatters.
    hasty = _follow(Solver(robot, kernel, replace(precise, retreat=0.0)), robot, targets, workload.first, "off")
    assert hasty.steps.max() > 2.0 * LARGEST_STEP_OUT_OF_REACH


def _beyond(robot: Robot, targets: tuple[np.ndarray, np.ndarray], lengths: float) -> tuple[np.ndarray, np.ndarray]:
    """Targets moved along their rays from the shoulder, to so many lengths of the arm."""
    moved = []
    for T, arm in zip(targets, robot.arms, strict=True):
        ray = T[:3, 3] - arm.shoulder
        T = T.copy()
        T[:3, 3] = arm.shoulder + lengths * arm.reach * ray / np.linalg.norm(ray)
        moved.append(T)
    return moved[0], moved[1]


def _repeated(solver: Solver, left: np.ndarray, right: np.ndarray, q: np.ndarray, times: int) -> Iterator[Solution]:
    for _ in range(times):
        solution = solver.solve(left, right, q, collision="off")
        yield solution
        q = solution.q


@pytest.mark.parametrize("seed", range(3))
def test_static_unreachable_target_is_approached(
    robot: Robot, precise_solver: Solver, precise: Preset, front: np.ndarray, seed: int
) -> None:
    """To within 2 % of the error that Ipopt cannot lower any further, and to rest."""
    rng = np.random.default_rng(seed)
    posture = np.clip(front + rng.normal(0.0, 0.3, robot.nq), robot.lower, robot.upper)
    left, right = _beyond(robot, robot.fk(posture), 1.3)
    answers = list(_repeated(precise_solver, left, right, front, 300))
    costs = []
    for solution in answers:
        position, rotation = robot.wrist_errors(solution.q, left, right)
        costs.append(precise.position * position @ position + precise.rotation * rotation @ rotation)
    ipopt = Reference(robot, replace(precise, smoothness=1e-9), {"max_iter": 500, "tol": 1e-10, "print_level": 0})
    best, _, converged = ipopt.solve(left, right, answers[-1].q)
    assert converged
    position, rotation = robot.wrist_errors(best, left, right)
    least = precise.position * position @ position + precise.rotation * rotation @ rotation
    assert costs[0] > 1.2 * least  # else there would be nothing to approach
    assert costs[-1] <= 1.02 * least
    assert np.all(np.diff(costs) <= 1e-3 * least)
    assert {solution.status for solution in answers} == {Status.UNREACHABLE}
    steps = np.abs(np.diff([solution.q for solution in answers], axis=0)).max(1)
    assert steps[-1] <= 1e-3
    assert steps[-50:].max() <= steps[:50].max()


@pytest.mark.parametrize("seed", range(4))
def test_return_into_reach_without_a_lurch(
    robot: Robot, kernel: Kernel, precise: Preset, front: np.ndarray, seed: int
) -> None:
    """Straight out and back again: the way back asks for no larger steps than exact inverse kinematics takes."""
    rng = np.random.default_rng(seed)
    base = robot.fk(np.clip(front + rng.normal(0.0, 0.2, robot.nq), robot.lower, robot.upper))
    out = np.linspace(0.75, 1.15, 200)
    targets = [_beyond(robot, base, lengths) for lengths in (*out, *out[::-1])]
    mine, plain = (Solver(robot, kernel, preset) for preset in (precise, replace(precise, retreat=0.0)))
    start = list(_repeated(mine, *targets[0], front, 30))[-1].q
    slowed, exact = (_follow(solver, robot, targets, start, "off") for solver in (mine, plain))
    assert slowed.statuses[0] is slowed.statuses[-1] is Status.OK
    assert slowed.statuses[200] is Status.UNREACHABLE
    assert slowed.position[-1].max() <= POSITION_P99
    assert slowed.steps[200:].max() <= 1.15 * exact.steps[200:].max()
    assert slowed.steps.max() < 0.5 * exact.steps.max()  # on the way out the exact one leaps at the boundary
