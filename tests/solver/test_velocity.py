"""Rate control: what the laws give where nothing limits, and what happens where something does."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_proto.limits import DEFAULT_ACCELERATION, DEFAULT_SPEED
from ik_service.dampers import RATE
from ik_service.resolved_rate import SINGULAR
from ik_service.robot import Robot
from ik_service.velocity import RateController, Velocity
from ik_service.velocity_kernel import VelocityKernel, agree, load_velocity_kernel
from ik_service.velocity_law import velocity_law

PERIOD = 0.02
HOME = np.array([0.0, 0.3, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0, -0.3, 0.0, 0.3, 0.0, 0.0, 0.0])
STILL = np.zeros(6)
STOPPED = 0.006
"""Speed of a hand that has stopped, or hardly moves [m/s]."""
STRAIGHT = 1.4202
"""Elbow angle at which the arm of `HOME` cannot reach farther [rad]."""


@pytest.fixture(scope="module")
def kernel(robot: Robot, kernel_cache: Path) -> VelocityKernel:
    return load_velocity_kernel(robot, folder=kernel_cache)


@pytest.fixture(scope="module")
def control(robot: Robot, kernel: VelocityKernel) -> RateController:
    return RateController(robot, kernel)


class Oracle:
    """Jacobians by Pinocchio, from the robot's model."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.model = robot, robot._model
        self.data = self.model.createData()

    def jacobians(self, q: np.ndarray, waist: np.ndarray) -> list[np.ndarray]:
        """Linear and angular velocity of each wrist in the pelvis frame: waist columns, then the arm's."""
        robot, model, data = self.robot, self.model, self.data
        pin.computeJointJacobians(model, data, robot._to_model(q, waist))
        pin.updateFramePlacements(model, data)
        turn = np.kron(np.eye(2), data.oMf[robot._base_frame].rotation.T)
        found = []
        for arm, frame in enumerate(robot._wrist_frames):
            J = turn @ pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            found.append(J[:, [*robot._waist_order, *robot._arm_order[7 * arm : 7 * arm + 7]]])
        return found


@pytest.fixture(scope="module")
def oracle(robot: Robot) -> Oracle:
    return Oracle(robot)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two velocities [degrees]."""
    lengths = np.linalg.norm(a) * np.linalg.norm(b)
    return float(np.degrees(np.arccos(np.clip(a @ b / lengths, -1.0, 1.0)))) if lengths > 0.0 else 0.0


def drive(
    control: RateController, q: np.ndarray, command: Callable[[float], np.ndarray], seconds: float, **options: object
) -> Iterator[tuple[float, np.ndarray, np.ndarray, Velocity]]:
    """Follow the answers from rest: time, joints, acceleration and answer of each tick; both hands get the command."""
    q, dq = q.copy(), np.zeros(len(q))
    for k in range(round(seconds / PERIOD)):
        answer = control.solve(command(k * PERIOD), command(k * PERIOD), q, dq, **options)  # ty: ignore
        yield k * PERIOD, q.copy(), (answer.dq - dq) / PERIOD, answer
        dq = answer.dq
        q = q + PERIOD * dq


def random_postures(robot: Robot, count: int, seed: int) -> Iterator[np.ndarray]:
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield rng.uniform(robot.lower, robot.upper)


def test_twist_is_achieved_where_nothing_limits(robot: Robot, control: RateController, oracle: Oracle) -> None:
    """5,000 arms in postures that are not singular, within one per cent by Pinocchio's Jacobian."""
    rng, arms, worst = np.random.default_rng(1), 0, 0.0
    for q in random_postures(robot, 6000, 0):
        twists = rng.normal(0.0, [[0.005] * 3 + [0.01] * 3], (2, 6))
        answer = control.solve(*twists, q, collision="off")
        jacobians = oracle.jacobians(q, np.zeros(3))
        for arm in range(2):
            if answer.limited_by[arm] or answer.manipulability[arm] < SINGULAR["held"]:
                continue
            arms += 1
            achieved = jacobians[arm][:, 3:] @ answer.dq[7 * arm : 7 * arm + 7]
            worst = max(worst, float(np.linalg.norm(achieved - twists[arm]) / np.linalg.norm(twists[arm])))
            assert answer.damping[arm] < 0.005
        assert np.allclose(answer.twists[0], jacobians[0][:, 3:] @ answer.dq[:7], rtol=0.0, atol=1e-12)
        if arms >= 5000:
            break
    assert arms >= 5000
    assert worst < 2e-3


def test_fixed_law_is_the_closed_form(robot: Robot, control: RateController, oracle: Oracle) -> None:
    """The damped pseudoinverse of the linear part with the waist's first column in it, whose row is dropped."""
    rng, compared = np.random.default_rng(2), 0
    for q in random_postures(robot, 300, 3):
        waist, damping = rng.uniform(-0.3, 0.3, 3), rng.uniform(0.01, 0.1)
        v = rng.normal(0.0, 0.05, (2, 3))
        answer = control.solve(*v, q, law="fixed", damping=damping, collision="off", waist=waist)
        for arm, J in enumerate(oracle.jacobians(q, waist)):
            J = J[:3, [0, *range(3, 10)]]
            wanted = (J.T @ np.linalg.inv(J @ J.T + damping**2 * np.eye(3)) @ v[arm])[1:]
            mine = answer.dq[7 * arm : 7 * arm + 7]
            if answer.limited_by[arm]:
                assert angle(mine, wanted) < 1e-3 or not mine.any()
                continue
            compared += 1
            assert np.abs(mine - wanted).max() < 1e-10
            assert answer.damping[arm] == damping
    assert compared > 400


def test_twists_by_finite_differences(robot: Robot, control: RateController) -> None:
    """In the frame of each hand, with a bent waist: what the wrists do is what the answer says."""
    rng, step = np.random.default_rng(4), 1e-6
    for q in random_postures(robot, 50, 5):
        waist = rng.uniform(-0.3, 0.3, 3)
        answer = control.solve(*rng.normal(0.0, 0.1, (2, 6)), q, frame="hand", waist=waist, collision="off")
        before, after = robot.fk(q - step * answer.dq, waist), robot.fk(q + step * answer.dq, waist)
        for arm, now in enumerate(robot.fk(q, waist)):
            R = now[:3, :3]
            linear = R.T @ (after[arm][:3, 3] - before[arm][:3, 3]) / (2.0 * step)
            angular = R.T @ pin.log3(after[arm][:3, :3] @ before[arm][:3, :3].T) / (2.0 * step)
            assert np.allclose(answer.twists[arm], [*linear, *angular], rtol=0.0, atol=1e-8)


def test_orientation_is_held_or_left_free(robot: Robot, control: RateController) -> None:
    v = np.array([0.02, 0.01, -0.02])
    held = control.solve(v, v, HOME, collision="off")
    free = control.solve(v, v, HOME, hold=(True, False), collision="off")
    assert np.allclose(held.twists, [[*v, 0.0, 0.0, 0.0]] * 2, rtol=0.0, atol=1e-9)
    assert np.allclose(free.twists[1, :3], v, rtol=0.0, atol=1e-9)
    assert np.linalg.norm(free.twists[1, 3:]) > 1e-3
    assert np.linalg.norm(free.dq[7:]) < np.linalg.norm(held.dq[7:])


def test_nothing_commanded_nothing_moves(robot: Robot, control: RateController) -> None:
    for q in random_postures(robot, 100, 6):
        answer = control.solve(STILL, STILL, q)
        assert not answer.dq.any()
        assert np.isfinite([*answer.manipulability, *answer.damping]).all()


def test_straight_elbow_stops_and_lets_go(control: RateController) -> None:
    outward = np.array([0.2, 0.0, 0.13, 0.0, 0.0, 0.0])
    speeds = []
    for t, _, acceleration, answer in drive(control, HOME, lambda t: outward if t < 3.0 else -outward, 4.0):
        achieved = answer.twists[0, :3]
        speeds.append(np.linalg.norm(achieved))
        assert np.abs(answer.dq).max() <= DEFAULT_SPEED + 1e-9
        assert np.abs(acceleration).max() <= DEFAULT_ACCELERATION + RATE * DEFAULT_SPEED
        if np.linalg.norm(achieved) > STOPPED and not 3.0 <= t < 3.3:
            assert angle(achieved, (outward if t < 3.0 else -outward)[:3]) < 5.0
        if 2.8 < t < 3.0:
            assert answer.limited_by[0] == "singularity"
            assert np.linalg.norm(achieved) < STOPPED
    assert max(speeds[-10:]) > 0.15


@pytest.mark.parametrize("direction", [(-1, 0, 0), (0, 0, 1), (-1, 0.5, -0.5), (0.3, -1, 0)])
def test_exactly_singular_posture_can_be_left(control: RateController, direction: tuple[float, ...]) -> None:
    start = HOME.copy()
    start[0], start[3], start[10] = -0.8, STRAIGHT, STRAIGHT
    command = np.array([*direction, 0.0, 0.0, 0.0]) * 0.1 / np.linalg.norm(direction)
    moved = [np.linalg.norm(answer.twists[0, :3]) for *_, answer in drive(control, start, lambda _: command, 2.0)]
    assert moved[0] < STOPPED or angle(command[:3], np.array(direction)) < 5.0
    assert max(moved) > 0.03


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from([0.05, 0.2, 0.4]), st.booleans())
def test_anywhere_speed_and_acceleration_are_bounded(
    robot: Robot, control: RateController, seed: int, speed: float, held: bool
) -> None:
    """And joints stay within their limits, stop without chatter, and hands keep their direction."""
    rng = np.random.default_rng(seed)
    command = np.array([*rng.normal(size=3), 0.0, 0.0, 0.0])
    command *= speed / np.linalg.norm(command)
    q0 = rng.uniform(0.95 * robot.lower, 0.95 * robot.upper)
    turns, signs = np.zeros(14), np.zeros(14)
    for _, q, acceleration, answer in drive(control, q0, lambda _: command, 2.0, collision="off", hold=(held, True)):
        assert (q > robot.lower).all()
        assert (q < robot.upper).all()
        assert np.abs(answer.dq).max() <= DEFAULT_SPEED + 1e-9
        assert np.abs(acceleration).max() <= DEFAULT_ACCELERATION + RATE * DEFAULT_SPEED
        new = np.where(np.abs(answer.dq) > 0.02, np.sign(answer.dq), signs)
        turns += (new * signs) < 0
        signs = new
    assert turns.max() <= 6


def test_every_joint_limit_is_approached_smoothly_and_left(robot: Robot, control: RateController) -> None:
    """The hand is led so that one joint after the other would run into each of its limits."""
    for joint in range(7):
        for end in (robot.lower, robot.upper):
            q = HOME.copy()
            q[joint] = end[joint] - 0.05 * np.sign(end[joint])
            push = np.zeros(14)
            push[joint] = 0.5 * np.sign(end[joint])
            T = robot.fk(q)[0]
            nudged = robot.fk(q + 1e-6 * push)[0]
            towards = np.array([*(nudged - T)[:3, 3], *pin.log3(nudged[:3, :3] @ T[:3, :3].T)]) * 1e6
            *_, (_, stopped, _, _) = drive(control, q, lambda _, v=towards: v, 1.5, collision="off")
            assert robot.lower[joint] < stopped[joint] < robot.upper[joint]
            *_, (_, left, _, _) = drive(control, stopped, lambda _, v=towards: -v, 1.0, collision="off")
            assert abs(left[joint] - end[joint]) > abs(stopped[joint] - end[joint])


def test_box_stops_the_hand_and_lets_it_back(robot: Robot, control: RateController) -> None:
    p = robot.fk(HOME)[0][:3, 3]
    box = np.array([p - 0.05, p + 0.05])
    for axis in range(3):
        for side in (-1.0, 1.0):
            command = np.zeros(6)
            command[axis] = 0.15 * side
            states = list(
                drive(control, HOME, lambda t, v=command: v if t < 1.5 else -v, 2.0, left_bounds=box, collision="off")
            )
            positions = np.array([robot.fk(q)[0][:3, 3] for _, q, _, _ in states])
            assert (positions > box[0] - 1e-6).all()
            assert (positions < box[1] + 1e-6).all()
            assert states[70][3].limited_by == ("bounds", states[70][3].limited_by[1])
            assert np.linalg.norm(states[70][3].twists[0]) < STOPPED
            assert np.linalg.norm(states[-1][3].twists[0]) > 0.1


def test_body_is_kept_clear_of(robot: Robot, control: RateController) -> None:
    """Each hand is driven into the body and into the other hand; it stops before the margin and can go back."""
    for left in ([-0.2, -0.2, 0.0], [0.0, -0.25, 0.0], [-0.2, -0.1, 0.1]):
        left_twist = np.array([*left, 0.0, 0.0, 0.0])
        right_twist = left_twist * [1, -1, 1, 1, 1, 1]
        q, dq, clearances, speeds = HOME.copy(), np.zeros(14), [], []
        for k in range(150):
            sign = 1.0 if k < 100 else -1.0
            answer = control.solve(sign * left_twist, sign * right_twist, q, dq)
            clearances.append(answer.clearance)
            speeds.append(np.linalg.norm(answer.twists[0, :3]))
            if k == 99:
                assert "collision" in answer.limited_by
            dq = answer.dq
            q = q + PERIOD * dq
        assert min(clearances) > robot.collision.margin - 2e-4
        assert speeds[99] < STOPPED
        assert max(speeds[100:115]) > 0.9 * np.linalg.norm(left)


def test_hands_side_by_side_follow_each_other(robot: Robot, control: RateController) -> None:
    """The hand that is followed makes room; both go at full speed however near they are."""
    q = HOME.copy()
    for _ in range(400):
        q = q + PERIOD * control.solve(np.array([0.1, -0.2, 0.05]), np.array([0.1, 0.2, 0.05]), q).dq
    sideways = np.array([0.0, 0.05, 0.0])
    alone = control.solve(np.zeros(3), sideways, q)
    together = control.solve(sideways, sideways, q)
    assert alone.limited_by[1] == "collision"
    assert together.twists[1, 1] > 3.0 * alone.twists[1, 1]


def test_speed_is_cut_uniformly(robot: Robot, control: RateController) -> None:
    v = np.array([1.0, 0.4, 0.8])
    slow, fast = (control.solve(f * v, np.zeros(3), HOME, collision="off", posture_gain=0.0) for f in (0.01, 3.0))
    assert np.abs(fast.dq).max() == pytest.approx(DEFAULT_SPEED)
    assert fast.limited_by[0] == "speed"
    assert fast.limiting_joint[0] == robot.joint_names[int(np.argmax(np.abs(fast.dq)))]
    assert angle(fast.dq, slow.dq) < 1.0


def test_answer_depends_on_nothing_but_the_request(robot: Robot, control: RateController) -> None:
    v = np.array([0.1, 0.0, 0.1])
    first = control.solve(v, v, HOME)
    control.solve(
        -v, v, HOME, HOME, frame="hand", law="fixed", hold=(False, False), damping=0.2, max_speed=0.1, posture=HOME,
        left_bounds=np.array([[-1.0] * 3, [1.0] * 3]), waist=np.full(3, 0.2), collision="report",
    )  # fmt: skip
    again = control.solve(v, v, HOME)
    assert np.array_equal(first.dq, again.dq)
    assert first.nearest == again.nearest


def test_both_forms_agree(robot: Robot, kernel: VelocityKernel) -> None:
    if kernel.kind != "c":
        pytest.skip(f"no compiled rate control here: {kernel.note}")
    machine = velocity_law(robot)
    assert agree(robot, machine, kernel.law)


def test_another_law_does_not_agree(robot: Robot, kernel: VelocityKernel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ik_service.dampers.RATE", 2.0)
    assert not agree(robot, velocity_law(robot), kernel.law)


def test_without_a_compiler_the_virtual_machine_serves(small_robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    kernel = load_velocity_kernel(small_robot)
    assert kernel.kind == "vm"
    assert "no C compiler" in kernel.note
