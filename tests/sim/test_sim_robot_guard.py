"""The simulated robot behind its guard: what the arms do, in physics, when commands begin, end, and fail to come."""

import numpy as np
import pytest
from sim_operator import HOME, Operator

from ik_client.robot_end import EndState
from ik_client.robot_end.guard import RAMP
from ik_proto.robots import RobotDescription
from sim_client.robot import CONTROL_PERIOD, SimRobot


def test_the_arms_are_at_home_until_they_are_taken(g1: RobotDescription) -> None:
    """Hazard row "weight ramp / exit": with weight 0 the onboard controller holds them, whatever the commands say."""
    operator, left_alone = Operator(g1), SimRobot(g1)
    for _ in range(50):
        operator.send(operator.robot.read().q + 0.2, engaged=True)
        operator.advance()
        left_alone.advance()
    assert operator.robot.released
    np.testing.assert_array_equal(operator.robot.data.qpos, left_alone.data.qpos)


def test_taking_the_arms_moves_them_by_no_more_than_their_sag(g1: RobotDescription) -> None:
    """Hazard row "weight ramp / exit": the default ramp, in physics; taken where they hang, they sag once more."""
    operator = Operator(g1, ramp=RAMP)
    robot = operator.robot
    operator.advance(100)
    before = robot.read().q
    weights = []
    for _ in range(150):
        operator.send(before)
        operator.advance()
        weights.append(robot.guard.weight)
        assert np.abs(robot.read().dq).max() < 0.1
    assert robot.guard.state is EndState.READY
    assert weights.index(1.0) == round(RAMP / CONTROL_PERIOD) - 1
    assert np.abs(robot.read().q - before).max() < 0.03


def test_the_set_point_is_blended_by_its_weight(toy: RobotDescription) -> None:
    operator = Operator(toy)
    operator.engage()
    operator.go(100, [0.9, 0.5, -0.5, 0.2], tau=[1.0, 0.0, 0.0, -1.0])
    robot = operator.robot
    robot.guard._weight.value = 0.25
    robot.guard._weight._duration = 1e9
    operator.send([0.9, 0.5, -0.5, 0.2], tau=[1.0, 0.0, 0.0, -1.0], engaged=True)
    operator.advance()
    arms = [robot.model.actuator(name).id for name in toy.arm_joints]
    blended = 0.25 * np.array([0.9, 0.5, -0.5, 0.2]) + 0.75 * np.array(HOME)
    np.testing.assert_allclose(robot._q_wanted[arms], blended, atol=1e-6)
    np.testing.assert_allclose(robot._tau[arms], [0.25, 0.0, 0.0, -0.25], atol=1e-6)


@pytest.mark.parametrize("dies", ["silence", "nonsense"])
def test_when_the_source_dies_the_arms_brake_and_stay(g1: RobotDescription, dies: str) -> None:
    """Hazard rows "service crash", "stale target" and "lost connection": they hold, with torque, and nothing falls."""
    operator = Operator(g1)
    robot = operator.robot
    operator.engage()
    start, lift = robot.read().q, np.zeros(14)
    lift[[0, 7]] = -1.0  # Both upper arms forward and up, against gravity.
    tau = np.zeros(14)
    tau[[0, 7]] = -4.0
    for k in range(40):
        operator.go(1, start + 0.02 * (k + 1) * lift, tau)
    moving = robot.read()
    assert np.abs(moving.dq).max() > 0.5
    heights = []
    for _ in range(250):
        if dies == "nonsense":
            operator.send(np.full(14, np.nan), engaged=True)
        operator.advance()
        heights.append(robot.wrists()[0][2, 3])
    held = robot.read()
    assert robot.guard.state is EndState.READY
    assert robot.guard.weight == 1.0
    assert np.abs(held.dq).max() < 1e-2
    assert held.q_set is not None
    assert np.abs(held.q - held.q_set).max() < 0.06
    assert min(heights) > heights[0] - 0.02
    np.testing.assert_allclose(robot._tau[[robot.model.actuator(g1.arm_joints[0]).id]], -4.0)


def test_released_arms_go_back_to_the_onboard_controller(g1: RobotDescription) -> None:
    """Hazard row "weight ramp / exit"."""
    operator = Operator(g1, ramp=1.0)
    robot = operator.robot
    operator.advance(10)
    for engaged in [False] * 52 + [True] * 60:
        state = robot.read()
        operator.send(state.q if state.q_set is None else state.q_set, engaged=engaged)
        operator.advance()
    operator.go(60, robot.read().q + np.where(np.arange(14) % 7 == 0, -0.8, 0.0))
    robot.release()
    weights = []
    while not robot.released:
        operator.advance()
        weights.append(robot.guard.weight)
        assert len(weights) <= 60
    assert weights[-1] == 0.0
    assert np.diff(weights).min() == pytest.approx(-CONTROL_PERIOD / 1.0)
    operator.advance(100)
    assert np.abs(robot.read().q - [g1.joint(name).home for name in g1.arm_joints]).max() < 0.06
