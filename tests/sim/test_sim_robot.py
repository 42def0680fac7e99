"""The simulated robot: torques, limits, names, a base that stays, and mistakes answered in one line."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from sim_fakes import TOY_MODEL
from sim_operator import HOME, Operator

from ik_client import IKClient
from ik_proto.robots import RobotDescription, RobotError, load_description
from sim_client.arms import ArmKinematics
from sim_client.robot import CONTROL_PERIOD, STEPS_PER_TICK, SimRobot


def put_home(robot: SimRobot) -> None:
    """Move every joint home, at rest."""
    robot.data.qpos[robot._q_address] = robot._home
    robot.data.qvel[:] = 0.0


def joint_torque(robot: SimRobot, name: str) -> float:
    """Torque that MuJoCo applied to a joint in its last step [N m]."""
    return float(robot.data.joint(name).qfrc_actuator[0])


def test_a_tick_is_four_physics_steps(toy: RobotDescription) -> None:
    robot = SimRobot(toy)
    robot.advance()
    assert robot.model.opt.timestep * STEPS_PER_TICK == pytest.approx(CONTROL_PERIOD)
    assert robot.time == pytest.approx(CONTROL_PERIOD)


def test_starts_and_stays_near_home(g1: RobotDescription) -> None:
    robot = SimRobot(g1)
    for _ in range(250):
        robot.advance()
    for name, joint in g1.joints.items():
        position = float(robot.data.joint(name).qpos[0])
        assert position == pytest.approx(joint.home, abs=0.06), name
    assert np.abs(robot.data.qvel).max() < 1e-3


def test_at_rest_the_springs_carry_gravity(g1: RobotDescription) -> None:
    """Against MuJoCo's own bias force: kp (q* - q) balances gravity up to the dry friction of the joint."""
    robot = SimRobot(g1)
    for _ in range(500):
        robot.advance()
    mujoco.mj_forward(robot.model, robot.data)
    for name, joint in g1.joints.items():
        view = robot.data.joint(name)
        spring = joint.kp * (joint.home - float(view.qpos[0]))
        friction = float(robot.model.joint(name).frictionloss[0])
        assert abs(spring - float(view.qfrc_bias[0])) <= friction + 0.02, name


def test_torque_is_that_of_the_description(toy: RobotDescription) -> None:
    operator = Operator(toy)
    robot = operator.robot
    operator.engage()
    operator.go(50, [0.35, 0.02, 0.01, -0.29], tau=[0.5, 0.1, -0.2, 0.3])
    put_home(robot)
    before = {name: robot.data.joint(name).qpos[0] for name in (*toy.arm_joints, "leg")}
    robot.data.joint("right_b").qvel[0] = 0.4
    mujoco.mj_forward(robot.model, robot.data)
    assert joint_torque(robot, "left_a") == pytest.approx(60.0 * (0.35 - before["left_a"]) + 0.5)
    assert joint_torque(robot, "right_b") == pytest.approx(20.0 * (-0.29 - before["right_b"]) - 0.5 * 0.4 + 0.3)
    # Described nowhere: the defaults kp 50, kd 1, home 0.
    assert joint_torque(robot, "left_b") == pytest.approx(50.0 * (0.02 - before["left_b"]) + 0.1)
    assert joint_torque(robot, "leg") == pytest.approx(80.0 * (0.2 - before["leg"]))


def test_motors_are_cut_at_the_limits_of_the_file(toy: RobotDescription) -> None:
    operator = Operator(toy)
    robot = operator.robot
    operator.engage()
    operator.go(100, [2.0, 1.0, -2.0, -1.0])
    put_home(robot)
    mujoco.mj_forward(robot.model, robot.data)
    assert joint_torque(robot, "left_a") == pytest.approx(7.0)  # its actuator's forcerange
    assert joint_torque(robot, "left_b") == pytest.approx(4.0)  # the joint's own
    assert joint_torque(robot, "right_a") == pytest.approx(-6.0)


def test_every_motor_of_the_g1_has_the_limit_of_its_model(g1: RobotDescription) -> None:
    file = mujoco.MjModel.from_xml_path(str(g1.model))
    robot = SimRobot(g1)
    for name in g1.joints:
        np.testing.assert_allclose(
            robot.model.actuator(name).forcerange, file.jnt_actfrcrange[file.joint(name).id], err_msg=name
        )


def test_order_is_by_name(toy: RobotDescription) -> None:
    robot = SimRobot(toy)
    for name, position in zip(toy.arm_joints, (0.1, 0.2, 0.3, 0.4), strict=True):
        robot.data.joint(name).qpos[0] = position
        robot.data.joint(name).qvel[0] = -position
    np.testing.assert_array_equal(robot.read().q, [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(robot.read().dq, [-0.1, -0.2, -0.3, -0.4])


def test_a_command_moves_its_own_joint(toy: RobotDescription) -> None:
    moving, resting = Operator(toy), Operator(toy)
    for operator, q in ((moving, [0.4, 0.5, 0.0, -0.3]), (resting, HOME)):
        operator.engage()
        operator.go(150, q)
    moved = moving.robot.read().q - resting.robot.read().q
    assert moved[1] == pytest.approx(0.5, abs=0.02)
    assert np.abs(np.delete(moved, 1)).max() < 0.02


def test_measurements_carry_the_time_of_the_clock(toy: RobotDescription) -> None:
    assert SimRobot(toy, clock=lambda: 12.5).read().time == 12.5


def test_the_waist_is_measured_in_the_order_of_the_description(g1: RobotDescription) -> None:
    robot = SimRobot(g1)
    for name, position in zip(g1.waist, (0.1, -0.2, 0.3), strict=True):
        robot.data.joint(name).qpos[0] = position
    waist = robot.read().waist
    assert waist is not None
    np.testing.assert_array_equal(waist, [0.1, -0.2, 0.3])


def test_a_robot_without_a_waist_measures_none(toy: RobotDescription) -> None:
    assert SimRobot(toy).read().waist is None


def test_targets_are_met_though_the_waist_gives_way(g1: RobotDescription, service_process) -> None:
    """Push the torso forward: with the measured waist, the answer's wrists are on target where the body really is."""
    robot = SimRobot(g1)
    left, right = robot.wrists()
    robot.data.joint("waist_pitch_joint").qpos[0] = 0.2
    measured = robot.read()
    distances = []
    with IKClient(service_process.tcp_url, timeout=5.0) as client:
        for waist in (measured.waist, None):
            q = client.solve(left, right, measured.q, waist=waist).sol_q
            assert q is not None
            for name, position in zip(g1.arm_joints, q, strict=True):
                robot.data.joint(name).qpos[0] = position
            mujoco.mj_kinematics(robot.model, robot.data)
            distances.append(np.linalg.norm(robot.wrists()[0][:3, 3] - left[:3, 3]))
    with_waist, without = distances
    assert with_waist < 5e-4
    assert without > 0.02


def test_a_measurement_does_not_change_afterwards(toy: RobotDescription) -> None:
    operator = Operator(toy)
    operator.engage()
    before = operator.robot.read()
    kept = before.q.copy(), before.q_set.copy() if before.q_set is not None else None
    operator.go(5, [0.0, 0.5, 0.5, 0.5])
    np.testing.assert_array_equal(before.q, kept[0])
    np.testing.assert_array_equal(before.q_set, kept[1])


def test_the_base_is_held_in_space(toy: RobotDescription) -> None:
    robot = SimRobot(toy)
    assert mujoco.mjtJoint.mjJNT_FREE not in robot.model.jnt_type
    before = robot.data.body("base").xpos.copy()
    for _ in range(100):
        robot.advance()
    np.testing.assert_array_equal(robot.data.body("base").xpos, before)


def test_ticks_without_a_command_are_counted(toy: RobotDescription) -> None:
    operator = Operator(toy)
    for i in range(10):
        if i % 2:
            operator.send(HOME)
        operator.advance()
    assert (operator.robot.ticks, operator.robot.ticks_without_command) == (10, 5)


def test_a_command_that_is_dropped_is_none(toy: RobotDescription) -> None:
    operator = Operator(toy)
    operator.send(np.full(4, np.nan))
    operator.advance()
    assert operator.robot.ticks_without_command == 1


def test_targets_come_back_as_they_were_shown(g1: RobotDescription, g1_arms: ArmKinematics) -> None:
    robot = SimRobot(g1)
    shown = g1_arms.wrists(np.linspace(-0.4, 0.5, 14))
    robot.show_targets(*shown)
    for back, T in zip(robot.shown_targets(), shown, strict=True):
        np.testing.assert_allclose(back, T, atol=1e-12)


def test_wrists_agree_with_the_arms_alone(g1: RobotDescription, g1_arms: ArmKinematics) -> None:
    robot = SimRobot(g1)
    for actual, expected in zip(robot.wrists(), g1_arms.wrists(robot.read().q), strict=True):
        np.testing.assert_allclose(actual, expected, atol=1e-12)


def test_wrist_frame_is_where_the_description_puts_it(toy: RobotDescription) -> None:
    left, right = ArmKinematics(toy).wrists(np.zeros(4))
    np.testing.assert_allclose(left[:3, 3], [0.4, 0.2, 0.0], atol=1e-12)
    np.testing.assert_allclose(right[:3, 3], [0.4, -0.2, 0.0], atol=1e-12)
    np.testing.assert_allclose(left[:3, :3], np.eye(3), atol=1e-12)
    roll, pitch, yaw = 0.3, -0.2, 0.1
    x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    np.testing.assert_allclose(right[:3, :3], z @ y @ x, atol=1e-12)


def test_fk_agrees_with_the_service(g1_arms: ArmKinematics, service_process) -> None:
    """Over the wire, where Pinocchio computes it."""
    rng = np.random.default_rng(1)
    with IKClient(service_process.tcp_url, timeout=5.0) as client:
        info = client.info()
        assert tuple(info.joint_names) == g1_arms.joint_names
        np.testing.assert_allclose(info.shoulders, g1_arms.shoulders, atol=1e-9)
        np.testing.assert_allclose(info.reach, g1_arms.reach, rtol=0.02)
        for _ in range(50):
            q = rng.uniform(g1_arms.lower, g1_arms.upper)
            reply = client.fk(q)
            left, right = g1_arms.wrists(q)
            np.testing.assert_allclose(left, reply.left_wrist, atol=1e-9)
            np.testing.assert_allclose(right, reply.right_wrist, atol=1e-9)


def one_line_about(error: pytest.ExceptionInfo[RobotError], *words: str) -> None:
    text = str(error.value)
    assert "\n" not in text
    for word in words:
        assert word in text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('base = "base"', 'base = "torso"', ["toy.toml", "torso", "toy.xml"]),
        ('"left_a", "left_b"', '"left_x", "left_b"', ["toy.toml", "left_x", "toy.xml"]),
        ("[joints.leg]", "[joints.arm]", ["toy.toml", "arm"]),
    ],
)
def test_a_description_that_does_not_fit(toy_files: tuple[Path, Path], old: str, new: str, words: list[str]) -> None:
    toml, _ = toy_files
    assert old in toml.read_text()
    toml.write_text(toml.read_text().replace(old, new))
    with pytest.raises(RobotError) as error:
        SimRobot(load_description(toml))
    one_line_about(error, *words)


@pytest.mark.parametrize(
    ("model", "words"),
    [
        ("<mujoco><worldbody><body>", ["toy.xml"]),
        ("no xml at all", ["toy.xml"]),
        (TOY_MODEL.replace('joint name="left_a"', 'joint type="slide" name="left_a"'), ["left_a", "hinge"]),
        (TOY_MODEL.replace('size="0.02" mass="0.5"', 'size="-1" mass="0.5"', 1), ["toy.xml", "size"]),
    ],
)
def test_a_model_that_cannot_be_used(toy_files: tuple[Path, Path], model: str, words: list[str]) -> None:
    toml, file = toy_files
    file.write_text(model)
    with pytest.raises(RobotError) as error:
        SimRobot(load_description(toml))
    one_line_about(error, *words)


def test_an_arm_joint_without_limits_is_refused(toy_files: tuple[Path, Path]) -> None:
    toml, file = toy_files
    file.write_text(TOY_MODEL.replace('axis="0 0 1" range="-1 1"', 'axis="0 0 1"', 1))
    with pytest.raises(RobotError, match="right_b has no limits"):
        ArmKinematics(load_description(toml))


URDF = """<robot name="toy">
  <link name="base"><inertial><mass value="5"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  {arms}
</robot>"""
URDF_ARM = """
  <link name="{side}_upper"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="{side}_a" type="revolute"><parent link="base"/><child link="{side}_upper"/><origin xyz="0 {y} 0"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="6" velocity="3"/></joint>
  <link name="{side}_lower"><inertial><origin xyz="0.1 0 0"/><mass value="0.3"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="{side}_b" type="revolute"><parent link="{side}_upper"/><child link="{side}_lower"/>
    <origin xyz="0.2 0 0"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="4" velocity="3"/></joint>"""


def test_a_urdf_is_the_same_robot(toy_files: tuple[Path, Path]) -> None:
    toml, _ = toy_files
    from_mjcf = ArmKinematics(load_description(toml))
    arms = URDF_ARM.format(side="right", y=-0.2) + URDF_ARM.format(side="left", y=0.2)
    (toml.parent / "toy.urdf").write_text(URDF.format(arms=arms))
    text = toml.read_text().replace("toy.xml", "toy.urdf").replace("[joints.leg]", "[joints.left_b]")
    toml.write_text(text)
    description = load_description(toml)
    from_urdf = ArmKinematics(description)
    q = np.array([0.3, -0.4, 0.5, 0.6])
    for a, b in zip(from_mjcf.wrists(q), from_urdf.wrists(q), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
    assert SimRobot(description).model.actuator("right_b").forcerange[1] == 4.0
