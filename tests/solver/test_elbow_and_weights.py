"""Elbow hints and confidences: what they move, and what they leave alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from ik_proto import Status
from ik_proto.robots import RobotDescription
from ik_service.robot import Robot
from ik_service.solver import Mode, Solver

ElbowDirection = Callable[[np.ndarray, int, np.ndarray | None], np.ndarray]
MODES: tuple[Mode, ...] = ("track", "reach")
PULLS = {"out": (0.0, 1.0, 0.0), "down": (0.0, 0.3, -1.0), "back": (-1.0, 0.5, -0.5)}
"""Directions for the left elbow in the base frame; the right one's are mirrored."""

DRAWN = {"out": np.radians(10.0), "down": np.radians(1.0), "back": np.radians(1.0)}
"""How far the elbow comes on average: down is where it is anyway, back is where it cannot go."""


@pytest.fixture(scope="module")
def elbow_direction(robot: Robot, description: RobotDescription) -> ElbowDirection:
    """(q, arm, waist) -> unit vector from shoulder to elbow in the base frame, by Pinocchio."""
    model = pin.buildModelFromMJCF(str(description.model))
    data = model.createData()

    def direction(q: np.ndarray, arm: int, waist: np.ndarray | None) -> np.ndarray:
        configuration = np.zeros(model.nq)
        bent = np.zeros(3) if waist is None else waist
        for name, angle in zip((*robot.joint_names, *robot.waist.joint_names), (*q, *bent), strict=True):
            configuration[model.joints[model.getJointId(name)].idx_q] = angle
        pin.framesForwardKinematics(model, data, configuration)
        R_base = data.oMf[model.getFrameId(description.base)].rotation
        names = robot.arms[arm].joint_names
        shoulder, elbow = (data.oMi[model.getJointId(names[i])].translation for i in (0, 3))
        along = R_base.T @ (elbow - shoulder)
        return along / np.linalg.norm(along)

    return direction


def _pull(name: str, arm: int) -> np.ndarray:
    x, y, z = PULLS[name]
    direction = np.array([x, y if arm == 0 else -y, z])
    return direction / np.linalg.norm(direction)


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))


@pytest.mark.parametrize(
    "mode",
    ["track", "reach"],
)
@pytest.mark.parametrize("pull", PULLS)
@pytest.mark.parametrize("bent", [False, True])
def test_hint_draws_the_elbow_and_leaves_the_wrist(
    robot: Robot,
    precise_solver: Solver,
    elbow_direction: ElbowDirection,
    front: np.ndarray,
    mode: Mode,
    pull: str,
    bent: bool,
) -> None:
    """Over postures in front of the body: the more confidence, the nearer the elbow comes to the hint."""
    rng = np.random.default_rng(1)
    angles = {0.0: [], 0.3: [], 1.0: []}
    for k in range(12):
        arm, waist = k % 2, rng.uniform(-0.3, 0.3, 3) if bent else None
        posture = np.clip(front + rng.normal(0.0, 0.25, robot.nq), robot.lower, robot.upper)
        targets, wish = robot.fk(posture, waist), _pull(pull, arm)
        for confidence, found in angles.items():
            q, hint = front, np.array([*wish, confidence])
            hints: dict[str, Any] = {("left_elbow", "right_elbow")[arm]: hint}
            for _ in range(40 if mode == "track" else 1):
                solution = precise_solver.solve(*targets, q, mode=mode, collision="off", waist=waist, **hints)
                q = solution.q
            assert solution.status is Status.OK
            assert solution.position_error.max() <= 0.1e-3
            assert solution.rotation_error.max() <= np.radians(0.1)
            found.append(_angle(elbow_direction(q, arm, waist), wish))
    without, some, full = (float(np.mean(found)) for found in angles.values())
    assert full < without - DRAWN[pull]
    assert full <= some <= without


@pytest.mark.parametrize("arm", [0, 1])
def test_hint_moves_its_own_arm_only(robot: Robot, precise_solver: Solver, front: np.ndarray, arm: int) -> None:
    targets, hint = robot.fk(front), np.array([*_pull("out", arm), 1.0])
    plain = precise_solver.solve(*targets, front, collision="off")
    hints: dict[str, Any] = {("left_elbow", "right_elbow")[arm]: hint}
    drawn = precise_solver.solve(*targets, front, collision="off", **hints)
    own, other = (slice(0, 7), slice(7, 14))[:: 1 if arm == 0 else -1]
    assert np.array_equal(drawn.q[other], plain.q[other])
    assert np.abs(drawn.q[own] - plain.q[own]).max() > 1e-3


@pytest.mark.parametrize("mode", MODES)
def test_no_confidence_is_no_hint(robot: Robot, precise_solver: Solver, front: np.ndarray, mode: Mode) -> None:
    targets = robot.fk(front + 0.1)
    plain = precise_solver.solve(*targets, front, mode=mode)
    nothing = np.array([0.6, 0.0, 0.8, 0.0])
    same = precise_solver.solve(
        *targets, front, mode=mode, left_elbow=nothing, right_elbow=nothing, weights=np.ones((2, 2))
    )
    assert np.array_equal(plain.q, same.q)
    assert plain.objective == same.objective


def test_hint_never_costs_a_reachable_target(
    robot: Robot, precise_solver: Solver, clear_postures: Callable[[int, int], np.ndarray]
) -> None:
    """Even where it asks for the impossible, an elbow behind the back; of arms that bend as people's do."""
    rng = np.random.default_rng(3)
    straight, _ = robot.arms[0].straight_elbow
    postures = clear_postures(3, 150)
    postures = postures[(postures[:, [3, 10]] < straight - 0.1).all(axis=1)]
    assert len(postures) > 50
    for q in postures:
        start = np.clip(q + rng.normal(0.0, 0.05, robot.nq), robot.lower, robot.upper)
        hints: dict[str, Any] = {}
        for side in ("left_elbow", "right_elbow"):
            direction = rng.normal(size=3)
            hints[side] = np.array([*direction / np.linalg.norm(direction), 1.0])
        solution = precise_solver.solve(*robot.fk(q), start, collision="off", **hints)
        assert solution.position_error.max() <= 1e-3
        assert solution.rotation_error.max() <= np.radians(1.0)


FREED = {"orientation": np.array([[1.0, 0.0], [1.0, 0.0]]), "position": np.array([[0.0, 1.0], [0.0, 1.0]])}


def _elsewhere(targets: tuple[np.ndarray, np.ndarray], freed: str, rng: np.random.Generator) -> list[np.ndarray]:
    """The same targets with what is freed thrown about."""
    moved = [T.copy() for T in targets]
    for T in moved:
        if freed == "orientation":
            T[:3, :3] = pin.exp3(rng.normal(0.0, 1.5, 3))
        else:
            T[:3, 3] += rng.normal(0.0, 1.0, 3)
    return moved


@pytest.mark.parametrize("freed", FREED)
@pytest.mark.parametrize("mode", MODES)
def test_no_confidence_frees(
    robot: Robot,
    precise_solver: Solver,
    clear_postures: Callable[[int, int], np.ndarray],
    freed: str,
    mode: Mode,
) -> None:
    """What is kept is met, whatever the rest of the target says; with it, the same targets are out of reach."""
    rng, missed = np.random.default_rng(4), 0
    for q in clear_postures(4, 40):
        start = np.clip(q + rng.normal(0.0, 0.1, robot.nq), robot.lower, robot.upper)
        targets = _elsewhere(robot.fk(q), freed, rng)
        request: dict[str, Any] = {"mode": mode, "collision": "off", "starts": 16}
        solution = precise_solver.solve(*targets, start, weights=FREED[freed], **request)
        position, rotation = robot.wrist_errors(solution.q, *targets)
        kept, limit = (position, 1e-3) if freed == "orientation" else (rotation, np.radians(1.0))
        assert kept.max() <= limit
        assert solution.status is Status.OK  # the freed part does not count as missed
        missed += precise_solver.solve(*targets, start, **request).status is not Status.OK
    assert missed > 10


@pytest.mark.parametrize("freed", FREED)
def test_what_is_freed_has_no_say(robot: Robot, precise_solver: Solver, front: np.ndarray, freed: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        q = np.clip(front + rng.normal(0.0, 0.25, robot.nq), robot.lower, robot.upper)
        targets = robot.fk(q)
        a, b = (
            precise_solver.solve(*each, front, collision="off", weights=FREED[freed])
            for each in (targets, _elsewhere(targets, freed, rng))
        )
        assert np.array_equal(a.q, b.q)
        assert a.objective == b.objective


def test_each_confidence_is_for_its_own_wrist(robot: Robot, precise_solver: Solver, front: np.ndarray) -> None:
    """Left orientation and right position freed: each keeps the other half of its target."""
    rng = np.random.default_rng(6)
    left, right = robot.fk(np.clip(front + rng.normal(0.0, 0.2, robot.nq), robot.lower, robot.upper))
    left[:3, :3] = pin.exp3(rng.normal(0.0, 1.0, 3))
    right[:3, 3] += 1.0
    solution = precise_solver.solve(left, right, front, collision="off", weights=np.array([[1.0, 0.0], [0.0, 1.0]]))
    assert solution.position_error[0] <= 1e-3
    assert solution.rotation_error[1] <= np.radians(1.0)
    assert solution.rotation_error[0] > 0.1
    assert solution.position_error[1] > 0.1


def test_less_confidence_gives_way(robot: Robot, precise_solver: Solver, front: np.ndarray) -> None:
    """Where position and orientation cannot both be had, the more trusted one wins."""
    left, right = (T.copy() for T in robot.fk(front))
    left[:3, 3] = robot.arms[0].shoulder + 0.98 * robot.arms[0].reach * np.array([1.0, 0.0, 0.0])
    left[:3, :3] = pin.exp3(np.array([0.0, 0.0, 2.5]))
    errors = []
    for orientation in (1.0, 0.3, 0.05):
        q = front
        for _ in range(100):
            q = precise_solver.solve(
                left, right, q, collision="off", weights=np.array([[1.0, orientation], [1.0, 1.0]])
            ).q
        errors.append([float(part[0]) for part in robot.wrist_errors(q, left, right)])
    position, rotation = np.array(errors).T
    assert (np.diff(position) < 0.0).all()
    assert (np.diff(rotation) > 0.0).all()


def test_hint_leads_back_through_the_straight_arm(
    robot: Robot, precise_solver: Solver, elbow_direction: ElbowDirection
) -> None:
    """An elbow that bends the way no person's does bends as a person's again. Without a hint it stays as it is.

    Its wrist can stay where it is: the elbow goes to the other side of the line from shoulder to wrist.
    """
    straight = robot.arms[0].straight_elbow[0] + 0.1
    rng = np.random.default_rng(0)
    for _ in range(12):
        posture = np.zeros(robot.nq)
        posture[[0, 7]], posture[[3, 10]] = rng.uniform(-2.0, 0.5), straight + rng.uniform(0.1, 0.3)
        posture[1], posture[2], posture[4] = rng.uniform(0.2, 1.2), (yaw := rng.uniform(1.3, 1.8)), -yaw
        posture[[8, 9, 11]] = -posture[[1, 2, 4]]
        targets = robot.fk(posture)
        hints: dict[str, Any] = {
            f"{side}_elbow": np.array([*elbow_direction(posture, arm, None), 1.0])
            for arm, side in enumerate(("left", "right"))
        }
        hinted = unhinted = posture
        for _ in range(30):
            unhinted = precise_solver.solve(*targets, unhinted, collision="off").q
            solution = precise_solver.solve(*targets, hinted, collision="off", **hints)
            assert solution.status is Status.OK
            assert solution.position_error.max() < 1e-3
            hinted = solution.q
        assert np.all(unhinted[[3, 10]] > straight + 0.05)
        assert np.all(hinted[[3, 10]] < straight)


def test_what_a_hint_costs_an_elbow_that_bends_backwards(
    robot: Robot, precise_solver: Solver, clear_postures: Callable[[int, int], np.ndarray]
) -> None:
    """Where it cannot go over, as joints end before, it gives way by millimetres: a hint is for people's arms."""
    rng = np.random.default_rng(4)
    straight = robot.arms[0].straight_elbow[0] + 0.1
    postures = clear_postures(4, 100)
    postures = postures[(postures[:, [3, 10]] > straight).any(axis=1)]
    assert len(postures) > 20
    off = []
    for q in postures:
        hints: dict[str, Any] = {}
        for side in ("left_elbow", "right_elbow"):
            direction = rng.normal(size=3)
            hints[side] = np.array([*direction / np.linalg.norm(direction), 1.0])
        solution = precise_solver.solve(*robot.fk(q), q, collision="off", **hints)
        off.append(solution.position_error.max())
    assert max(off) < 5e-3
