"""Self-collision: what `avoid` keeps, never blocks and leaves alone; every distance by Pinocchio and coal.

The promise, pair by pair: an answer is no nearer than the margin, or no nearer than the request's q already was.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from body_oracle import CapsuleOracle
from hypothesis import given, settings
from hypothesis import strategies as st
from truth import check_clearance, check_truth, posed, poses

from benchmarks.workloads import crossing
from ik_proto import Status
from ik_proto.robots import RobotDescription
from ik_service.kernel import Kernel, load_kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solver import Solver

ROUNDING = 1e-9  # [m]
PLACES = {
    "chest": (0.0, 0.0, 0.15),
    "head": (0.02, 0.0, 0.42),
    "pelvis": (0.0, 0.0, -0.05),
    "thigh": (0.05, 0.1, -0.3),
    "front": (0.25, 0.0, 0.15),
    "behind": (-0.15, 0.0, 0.15),
    "left shoulder": (0.0, 0.1, 0.3),
    "right side": (0.2, -0.25, 0.1),
    "left side": (0.2, 0.25, 0.1),
}
"""Where hands are sent, in the base frame [m]: into the body, to each other, and across to the other side."""


@pytest.fixture(scope="module", params=["openwbt", "precise"])
def any_solver(request: pytest.FixtureRequest, robot: Robot, kernel: Kernel) -> Solver:
    preset: Preset = request.getfixturevalue("preset" if request.param == "openwbt" else "precise")
    return Solver(robot, kernel, preset)


def _shortfall(
    oracle: CapsuleOracle, margin: float, q: np.ndarray, answer: np.ndarray, waist: np.ndarray | None = None
) -> float:
    """By how much the worst pair breaks the promise [m]; not above zero where it is kept."""
    return float((np.minimum(oracle.distances(q, waist), margin) - oracle.distances(answer, waist)).max())


def _sent(rng: np.random.Generator, robot: Robot, kind: int) -> tuple[np.ndarray, np.ndarray]:
    """Targets: of random postures, of places, of the other arm's place, or one place for both."""
    if kind == 0:
        return robot.fk(rng.uniform(robot.lower, robot.upper))
    names = list(PLACES)
    spots = [np.array(PLACES[names[i]]) + rng.normal(0.0, 0.05, 3) for i in rng.integers(len(names), size=2)]
    if kind == 1:
        spots = [np.array(PLACES["right side"]), np.array(PLACES["left side"])]
    if kind == 2:
        spots[1] = spots[0]
    axes = rng.normal(0.0, 1.2, (2, 3))
    return posed(axes[0], spots[0]), posed(axes[1], spots[1])


@pytest.mark.parametrize("bent", [False, True])
def test_jumps_from_clear_starts_keep_the_margin_all_the_way(
    any_solver: Solver,
    robot: Robot,
    oracle: CapsuleOracle,
    clear_postures: Callable[[int, int], np.ndarray],
    bent: bool,
) -> None:
    """Arms crossing, hands into chest and head, hands together, unrelated postures: one request each, however far."""
    rng, margin, blocked, harmful = np.random.default_rng(1), robot.collision.margin, 0, 0
    for k, q in enumerate(clear_postures(1, 200)):
        waist = rng.uniform([-1.0, -0.3, -0.3], [1.0, 0.3, 0.3]) if bent else None
        if oracle.clearance(q, waist) < margin:
            continue
        left, right = _sent(rng, robot, k % 4)
        weights = rng.uniform(0.0, 1.0, (2, 2)) if k % 3 == 0 else None
        solution = any_solver.solve(left, right, q, waist=waist, weights=weights)
        check_truth(solution, robot, left, right, waist)
        check_clearance(solution, oracle, "avoid", waist)
        assert oracle.clearance(solution.q, waist) >= margin - ROUNDING
        assert oracle.along(q, solution.q, waist) > 0.0
        blocked += solution.status is Status.BLOCKED
        plain = any_solver.solve(left, right, q, collision="off", waist=waist, weights=weights)
        harmful += oracle.along(q, plain.q, waist) < 0.0
    assert blocked > 40
    assert harmful > 40  # negative control: without avoidance the same requests go through the body


@given(poses(), poses(), st.integers(0, 2**32 - 1))
@settings(max_examples=150)
def test_no_request_brings_a_pair_nearer(
    any_solver: Solver, robot: Robot, oracle: CapsuleOracle, left: np.ndarray, right: np.ndarray, seed: int
) -> None:
    """From any start within the limits, in contact or not, to any target at all."""
    q = np.random.default_rng(seed).uniform(robot.lower, robot.upper)
    solution = any_solver.solve(left, right, q)
    assert _shortfall(oracle, robot.collision.margin, q, solution.q) <= ROUNDING
    check_truth(solution, robot, left, right)
    check_clearance(solution, oracle, "avoid")


def test_from_contact_no_pair_comes_nearer(any_solver: Solver, robot: Robot, oracle: CapsuleOracle) -> None:
    rng, margin, tried, moved = np.random.default_rng(2), robot.collision.margin, 0, 0
    while tried < 200:
        q = rng.uniform(robot.lower, robot.upper)
        if oracle.clearance(q) >= margin:
            continue
        tried += 1
        solution = any_solver.solve(*_sent(rng, robot, tried % 4), q)
        assert _shortfall(oracle, margin, q, solution.q) <= ROUNDING
        moved += np.abs(solution.q - q).max() > 1e-3
    assert moved > 50  # standing still would keep the promise as well


@pytest.mark.parametrize("place", PLACES)
def test_paths_keep_the_margin(
    precise_solver: Solver, robot: Robot, oracle: CapsuleOracle, front: np.ndarray, place: str
) -> None:
    """Both hands are led to one place and back, frame by frame: hands together, to the head, into the body."""
    starts, margin = robot.fk(front), robot.collision.margin
    q, nearest = front, np.inf
    for share in (*np.linspace(0.0, 1.0, 60), *np.ones(10), *np.linspace(1.0, 0.0, 60)):
        targets = [T.copy() for T in starts]
        for T in targets:
            T[:3, 3] += share * (np.array(PLACES[place]) - T[:3, 3])
        previous, q = q, precise_solver.solve(targets[0], targets[1], q).q
        assert oracle.clearance(q) >= margin - ROUNDING
        assert oracle.along(previous, q) > 0.0
        nearest = min(nearest, oracle.clearance(q))
    assert nearest <= margin + 3e-3  # the body was in the way, and the hands came as near as they may


def test_crossing_arms_keep_the_margin(precise_solver: Solver, robot: Robot, oracle: CapsuleOracle) -> None:
    workload = crossing(robot)
    clearances, plain = [], []
    q = p = workload.first
    for left, right in zip(workload.left, workload.right, strict=True):
        q = precise_solver.solve(left, right, q).q
        p = precise_solver.solve(left, right, p, collision="off").q
        clearances.append(oracle.clearance(q))
        plain.append(oracle.clearance(p))
    assert min(clearances) >= robot.collision.margin - ROUNDING
    assert min(plain) < -0.02  # negative control


def test_free_ways_are_left_alone(
    any_solver: Solver, robot: Robot, oracle: CapsuleOracle, clear_postures: Callable[[int, int], np.ndarray]
) -> None:
    """Where the plain answer and the way to it are clear, from a start that is clear, it is the answer, bit for bit."""
    rng, same = np.random.default_rng(3), 0
    for k, q in enumerate(clear_postures(3, 300)):
        goal = np.clip(q + rng.normal(0.0, 0.03 if k % 2 else 0.2, robot.nq), robot.lower, robot.upper)
        plain = any_solver.solve(*robot.fk(goal), q, collision="report")
        if oracle.along(q, plain.q) < 1.01 * robot.collision.margin:
            continue
        avoided = any_solver.solve(*robot.fk(goal), q)
        assert np.array_equal(avoided.q, plain.q)
        assert avoided.status is plain.status
        same += 1
    assert same > 100


def _gradient(oracle: CapsuleOracle, q: np.ndarray, pair: int) -> np.ndarray:
    step = 1e-6 * np.eye(len(q))
    return np.array([oracle.distances(q + d)[pair] - oracle.distances(q - d)[pair] for d in step]) / 2e-6


def test_moving_apart_is_never_blocked(precise_solver: Solver, robot: Robot, oracle: CapsuleOracle) -> None:
    """One pair is too near, in contact or not. Asked to go where it opens, the arms get there, and open all the way."""
    rng, margin, tried = np.random.default_rng(4), robot.collision.margin, 0
    while tried < 40:
        q = rng.uniform(0.9 * robot.lower, 0.9 * robot.upper)
        distances = oracle.distances(q)
        near = np.flatnonzero(distances < margin)
        if len(near) != 1 or distances[near[0]] < -0.03:
            continue
        gradient = _gradient(oracle, q, near[0])
        goal = q
        while oracle.distances(goal)[near[0]] < margin + 5e-3:
            goal = goal + 0.02 * gradient / np.linalg.norm(gradient)
            if (goal < robot.lower).any() or (goal > robot.upper).any() or np.abs(goal - q).max() > 0.6:
                break
        else:
            if np.delete(oracle.distances(goal), near[0]).min() < margin + 5e-3:
                continue
            tried += 1
            targets, path = robot.fk(goal), [q]
            for _ in range(60):
                path.append(precise_solver.solve(*targets, path[-1]).q)
            opened = [oracle.distances(each)[near[0]] for each in path]
            assert opened[1] > opened[0] + 1e-4
            assert (np.diff(np.minimum(opened, margin)) >= -ROUNDING).all()
            assert opened[-1] >= margin - ROUNDING
            assert robot.wrist_errors(path[-1], *targets)[0].max() <= 1e-3


def test_hands_that_touch_come_apart(
    precise_solver: Solver, robot: Robot, oracle: CapsuleOracle, home: np.ndarray
) -> None:
    """Plain inverse kinematics puts the palms into each other; asked to go home, they part and arrive."""
    spot = np.array([0.28, 0.0, 0.12])
    left, right = (posed(np.zeros(3), spot + side * np.array([0.0, 0.03, 0.0])) for side in (1.0, -1.0))
    q = home
    for _ in range(20):
        q = precise_solver.solve(left, right, q, collision="off").q
    assert -0.06 < oracle.clearance(q) < 0.0
    targets, clearances = robot.fk(home), [oracle.clearance(q)]
    for _ in range(200):
        q = precise_solver.solve(*targets, q).q
        clearances.append(oracle.clearance(q))
    margin = robot.collision.margin
    assert (np.diff(np.minimum(clearances, margin)) >= -ROUNDING).all()
    assert clearances[1] > clearances[0]
    assert clearances[-1] >= margin - ROUNDING
    assert robot.wrist_errors(q, *targets)[0].max() <= 1e-3


def test_settings_do_what_they_say(
    any_solver: Solver, robot: Robot, oracle: CapsuleOracle, clear_postures: Callable[[int, int], np.ndarray]
) -> None:
    """`off` and `report` give the same answer, `report` measures it, `avoid` gives another where it has to."""
    rng, other = np.random.default_rng(5), 0
    for k, q in enumerate(clear_postures(5, 60)):
        targets = _sent(rng, robot, k % 4)
        off, report, avoid = (any_solver.solve(*targets, q, collision=each) for each in ("off", "report", "avoid"))
        assert np.array_equal(off.q, report.q)
        assert off.status is report.status
        assert off.status is not Status.BLOCKED
        for solution, setting in ((off, "off"), (report, "report"), (avoid, "avoid")):
            check_clearance(solution, oracle, setting)
        if report.clearance < robot.collision.margin:
            other += 1
            assert not np.array_equal(avoid.q, report.q)
            assert avoid.status is not Status.OK or np.abs(avoid.q - report.q).max() > 1e-6
    assert other > 20


def test_blocked_means_off_target_and_led_astray(
    any_solver: Solver, robot: Robot, clear_postures: Callable[[int, int], np.ndarray]
) -> None:
    """An answer on target is `ok` however it got there; one that missed for another reason is `unreachable`."""
    rng, seen = np.random.default_rng(6), set()
    plain_solver = Solver(robot, any_solver.kernel, replace(any_solver.preset, restarts=0))
    limits = any_solver.preset.tolerance(None)
    for k, q in enumerate(clear_postures(6, 100)):
        targets = _sent(rng, robot, k % 4)
        solution = any_solver.solve(*targets, q)
        plain = plain_solver.solve(*targets, q, collision="report")
        on_target = bool((np.concatenate(robot.wrist_errors(solution.q, *targets)) <= limits).all())
        led_astray = not np.array_equal(solution.q, plain.q)
        expected = Status.OK if on_target else Status.BLOCKED if led_astray else Status.UNREACHABLE
        assert solution.status is expected
        seen.add(expected)
    assert {Status.BLOCKED, Status.UNREACHABLE} <= seen


def test_both_kernels_keep_the_margin(
    robot: Robot,
    vm_kernel: Kernel,
    precise: Preset,
    oracle: CapsuleOracle,
    clear_postures: Callable[[int, int], np.ndarray],
) -> None:
    """What the other tests ask of the compiled kernel, in short, of the virtual machine."""
    solver, rng = Solver(robot, vm_kernel, precise), np.random.default_rng(7)
    for k, q in enumerate(clear_postures(7, 40)):
        solution = solver.solve(*_sent(rng, robot, k % 4), q)
        assert oracle.clearance(solution.q) >= robot.collision.margin - ROUNDING
        assert oracle.along(q, solution.q) > 0.0


@pytest.mark.parametrize("beyond", [0.02, 0.3])
def test_starts_beyond_the_limits_come_back(
    precise_solver: Solver, robot: Robot, oracle: CapsuleOracle, beyond: float
) -> None:
    """Limits come first: from a q beyond them, the promise counts from where bringing it back leads."""
    rng, margin = np.random.default_rng(8), robot.collision.margin
    for k in range(200):
        q = rng.uniform(robot.lower, robot.upper)
        out = rng.integers(robot.nq, size=3)
        q[out] = np.where(rng.uniform(size=3) < 0.5, robot.lower[out] - beyond, robot.upper[out] + beyond)
        solution = precise_solver.solve(*_sent(rng, robot, k % 4), q)
        assert (robot.lower <= solution.q).all()
        assert (solution.q <= robot.upper).all()
        assert _shortfall(oracle, margin, np.clip(q, robot.lower, robot.upper), solution.q) <= ROUNDING


def test_arms_of_unequal_length_keep_their_margin(armoured: RobotDescription) -> None:
    """Another robot: 4 and 5 joints, no waist, a wider margin, both arms listed in another order in the model."""
    robot, oracle = Robot.load(armoured), CapsuleOracle(armoured)
    solver = Solver(robot, load_kernel(robot, compiled=False), Preset.of(armoured, "openwbt"))
    rng, margin, tried, harmful, across = np.random.default_rng(9), robot.collision.margin, 0, 0, 0
    assert (margin, len(oracle.pairs)) == (0.02, 8)
    while tried < 300:
        q = rng.uniform(robot.lower, robot.upper)
        if oracle.clearance(q) < margin:
            continue
        tried += 1
        targets = robot.fk(rng.uniform(robot.lower, robot.upper))
        solution = solver.solve(*targets, q)
        check_truth(solution, robot, *targets)
        check_clearance(solution, oracle, "avoid")
        assert oracle.clearance(solution.q) >= margin - ROUNDING
        assert oracle.along(q, solution.q) > 0.0
        plain = solver.solve(*targets, q, collision="off")
        harmful += oracle.clearance(plain.q) < 0.0
        across += {name[0] for name in oracle.nearest(plain.q)} == {"a", "z"}
    assert harmful > 15
    assert across > 5


def test_oracle_has_the_pairs_of_the_description(robot: Robot, oracle: CapsuleOracle) -> None:
    """Else it would measure something else than the service, or too little."""
    names = [capsule.name for capsule in robot.collision.capsules]
    ours = sorted(tuple(sorted((names[i], names[j]))) for i, j in robot.collision.pairs)
    assert ours == sorted(oracle.pairs)
    assert len(oracle.pairs) > 60


def test_oracle_can_tell(robot: Robot, description: RobotDescription, oracle: CapsuleOracle, home: np.ndarray) -> None:
    """Negative control. Forearms turned into each other mirror each other, so the axes of the wrists cross."""
    assert oracle.clearance(home) > 2.0 * robot.collision.margin
    q = home.copy()
    for i, name in enumerate(robot.joint_names):
        side = 1.0 if name.startswith("left") else -1.0
        q[i] += -0.6 * name.endswith("shoulder_pitch_joint") - 0.6 * name.endswith("elbow_joint")
        q[i] -= side * (0.2 * name.endswith("shoulder_roll_joint") + 1.2 * name.endswith("shoulder_yaw_joint"))
    radius = next(each.radius for each in description.collision.capsules if each.name == "left_wrist")
    assert oracle.nearest(q) == ("left_wrist", "right_wrist")
    assert oracle.clearance(q) == pytest.approx(-2.0 * radius, abs=1e-9)
