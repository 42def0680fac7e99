"""The robot against MuJoCo, which reads the same file with its own code, and the errors of a wrong description."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from ik_proto.robots import RobotDescription, RobotError, load_description
from ik_service.robot import Robot

mujoco: Any = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def mujoco_model(description: RobotDescription) -> Any:
    return mujoco.MjModel.from_xml_path(str(description.model))


def _mujoco_data(model: Any, robot: Robot, q: np.ndarray, waist: np.ndarray) -> tuple[Any, list[int]]:
    data = mujoco.MjData(model)
    joints = [model.joint(name) for name in robot.joint_names]
    data.qpos[[joint.qposadr[0] for joint in joints]] = q
    data.qpos[[model.joint(name).qposadr[0] for name in robot.waist.joint_names]] = waist
    mujoco.mj_forward(model, data)
    return data, [joint.dofadr[0] for joint in joints]


def _random_postures(robot: Robot, count: int) -> np.ndarray:
    return np.random.default_rng(7).uniform(robot.lower, robot.upper, (count, robot.nq))


def _random_waists(count: int) -> np.ndarray:
    return np.random.default_rng(8).uniform([-2.5, -0.5, -0.5], [2.5, 0.5, 0.5], (count, 3))


def test_waist_is_yaw_roll_pitch(robot: Robot) -> None:
    assert robot.waist.joint_names == ("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint")


@pytest.mark.parametrize("bent", [False, True])
def test_fk_agrees_with_mujoco(robot: Robot, description: RobotDescription, mujoco_model: Any, bent: bool) -> None:
    for q, waist in zip(_random_postures(robot, 100), _random_waists(100), strict=True):
        data, _ = _mujoco_data(mujoco_model, robot, q, waist if bent else np.zeros(3))
        base = data.body(description.base)
        R_base = base.xmat.reshape(3, 3)
        for T_base_wrist, arm in zip(robot.fk(q, waist if bent else None), description.arms, strict=True):
            body = data.body(mujoco_model.joint(arm.wrist.joint).bodyid[0])
            R_wrist = body.xmat.reshape(3, 3)
            position = body.xpos + R_wrist @ np.array(arm.wrist.xyz)
            assert np.allclose(T_base_wrist[:3, 3], R_base.T @ (position - base.xpos), atol=1e-9)
            assert np.allclose(T_base_wrist[:3, :3], R_base.T @ R_wrist, atol=1e-9)


@pytest.mark.parametrize("bent", [False, True])
def test_gravity_torque_agrees_with_mujoco(robot: Robot, mujoco_model: Any, bent: bool) -> None:
    for q, waist in zip(_random_postures(robot, 100), _random_waists(100), strict=True):
        data, dofs = _mujoco_data(mujoco_model, robot, q, waist if bent else np.zeros(3))
        torque = robot.gravity_torque(q, waist if bent else None)
        assert np.allclose(torque, data.qfrc_bias[dofs], atol=1e-6)
        assert np.abs(torque).max() > 0.1


def test_bending_the_waist_is_felt(robot: Robot) -> None:
    """Negative control: the comparisons above can tell a bent waist from a straight one."""
    for q, waist in zip(_random_postures(robot, 20), _random_waists(20), strict=True):
        assert np.abs(robot.fk(q, waist)[0] - robot.fk(q)[0]).max() > 1e-3
        assert np.abs(robot.gravity_torque(q, waist) - robot.gravity_torque(q)).max() > 1e-3
    # Nor does it linger.
    assert np.array_equal(robot.fk(q)[0], robot.copy().fk(q)[0])


def test_wrist_errors_are_distance_and_angle(robot: Robot) -> None:
    for q, waist in zip(_random_postures(robot, 20), _random_waists(20), strict=True):
        turn, shift = pin.exp3(np.array([0.0, 0.6, 0.8]) * 0.3), np.array([0.0, 0.03, -0.04])
        targets = [T.copy() for T in robot.fk(q, waist)]
        targets[1][:3, :3] = turn @ targets[1][:3, :3]
        targets[1][:3, 3] += shift
        position, rotation = robot.wrist_errors(q, *targets, waist)
        assert np.allclose(position, [0.0, 0.05], atol=1e-12)
        assert np.allclose(rotation, [0.0, 0.3], atol=1e-7)


def test_limits_agree_with_mujoco(robot: Robot, mujoco_model: Any) -> None:
    ranges = np.array([mujoco_model.joint(name).range for name in robot.joint_names])
    assert np.array_equal(np.column_stack((robot.lower, robot.upper)), ranges)


def test_results_belong_to_the_caller(robot: Robot) -> None:
    first, second = _random_postures(robot, 2)
    torque, (left, right) = robot.gravity_torque(first), robot.fk(first)
    before = torque.copy(), left.copy(), right.copy()
    robot.gravity_torque(second)
    robot.fk(second)
    assert all(np.array_equal(now, then) for now, then in zip((torque, left, right), before, strict=True))


def test_chain_is_the_arm(robot: Robot) -> None:
    for q in _random_postures(robot, 50):
        for arm, part, T_base_wrist in zip(robot.arms, (q[:7], q[7:]), robot.fk(q), strict=True):
            assert np.allclose(arm.wrist(part), T_base_wrist, atol=1e-12)


def test_chain_does_many_postures_at_once(robot: Robot) -> None:
    postures = _random_postures(robot, 50)
    for arm, part in zip(robot.arms, (slice(0, 7), slice(7, 14)), strict=True):
        many = arm.wrists(postures[:, part])
        assert all(np.allclose(T, arm.wrist(q[part]), atol=1e-14) for T, q in zip(many, postures, strict=True))


def test_elbow_of_the_g1(robot: Robot, mujoco_model: Any) -> None:
    """The arm is straight at an elbow angle of 1.44 rad, and counts as hyperextended from 0.1 rad before that."""
    data, _ = _mujoco_data(mujoco_model, robot, np.zeros(robot.nq), np.zeros(3))
    for arm in robot.arms:
        assert arm.elbow == 3
        assert arm.straight_elbow == (pytest.approx(1.344, abs=2e-3), 1.0)
        shoulder, elbow = (data.xanchor[mujoco_model.joint(arm.joint_names[i]).id] for i in (0, 3))
        assert arm.upper_arm == pytest.approx(np.linalg.norm(elbow - shoulder), abs=1e-9)


def test_reach_of_the_g1(robot: Robot) -> None:
    """No sampled posture reaches farther; the farthest of 200,000 was measured at 0.459 m from the shoulder."""
    for arm, part in zip(robot.arms, (slice(0, 7), slice(7, 14)), strict=True):
        sampled = [np.linalg.norm(arm.wrist(q[part])[:3, 3] - arm.shoulder) for q in _random_postures(robot, 2000)]
        assert max(sampled) <= arm.reach
        assert arm.reach == pytest.approx(0.459, abs=1e-3)
    assert robot.arms[0].reach == pytest.approx(robot.arms[1].reach, abs=1e-4)
    assert np.allclose(robot.arms[0].shoulder, [0.0, 0.10022, 0.29178], atol=1e-4)


def test_wire_order_may_differ_from_model_order(make_robot: Callable[..., Path]) -> None:
    path = make_robot()
    robot = Robot.load(load_description(path))
    model = pin.buildModelFromUrdf(str(path.parent / "arms.urdf"))
    assert robot.joint_names == tuple(f"z_{i}" for i in range(4)) + tuple(f"a_{i}" for i in range(5))
    assert list(model.names)[1] == "a_0"

    data = model.createData()
    for q in _random_postures(robot, 20):
        q_model = np.concatenate((q[4:], q[:4]))
        torque = pin.rnea(model, data, q_model, np.zeros(9), np.zeros(9))
        assert np.allclose(robot.gravity_torque(q), np.concatenate((torque[5:], torque[:5])), atol=1e-12)
        for arm, part, T_base_wrist in zip(robot.arms, (q[:4], q[4:]), robot.fk(q), strict=True):
            assert np.allclose(arm.wrist(part), T_base_wrist, atol=1e-12)


@pytest.mark.parametrize(
    ("urdf", "toml", "words"),
    [
        (("", ""), ("'a_2'", "'a_9'"), "joint a_9 is not in arms.urdf"),
        (("", ""), ('base = "trunk"', 'base = "chest"'), "base chest is not a body of arms.urdf"),
        (("", ""), ('base = "trunk"', 'base = "z_1_link"'), "base z_1_link moves with the arms"),
        (("", ""), ("'z_1', 'z_2'", "'z_2', 'z_1'"), "joint z_2 does not follow z_0 in the model"),
        (("", ""), ("'z_0', 'z_1', ", "'z_1', 'z_0', "), "joint z_1 does not follow trunk in the model"),
        (('name="z_2" type="revolute"', 'name="z_2" type="prismatic"'), ("", ""), "joint z_2 is not a revolute"),
        (('name="z_2" type="revolute"', 'name="z_2" type="continuous"'), ("", ""), "joint z_2 is not a revolute"),
        (('name="a_1" type="revolute"', 'name="a_1" type="fixed"'), ("", ""), "joint a_1 is not in arms.urdf"),
        (
            ("", ""),
            ("[presets.openwbt]", '[waist]\njoints = ["z_0"]\n[presets.openwbt]'),
            "joint z_0 does not follow z_0 in the model",
        ),
        (
            ("", ""),
            ("[presets.openwbt]", '[waist]\njoints = ["spine"]\n[presets.openwbt]'),
            "spine is not in arms.urdf",
        ),
        (('lower="-2" upper="2.5"', 'lower="2" upper="-2"'), ("", ""), "joint z_0 has no usable position limits"),
    ],
)
def test_wrong_description_names_the_culprit(
    make_robot: Callable[..., Path], urdf: tuple[str, str], toml: tuple[str, str], words: str
) -> None:
    path = make_robot(urdf, toml)
    with pytest.raises(RobotError) as caught:
        Robot.load(load_description(path))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "content", ["", "not xml at all", "<robot", "<robot name='x'/>", "<mujoco><worldbody/></mujoco>"]
)
@pytest.mark.parametrize("suffix", ["urdf", "xml"])
def test_unreadable_model_is_one_line(
    make_robot: Callable[..., Path], content: str, suffix: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = make_robot(replace_toml=("arms.urdf", f"arms.{suffix}"))
    (path.parent / f"arms.{suffix}").write_text(content)
    with pytest.raises(RobotError) as caught:
        Robot.load(load_description(path))
    assert "\n" not in str(caught.value)
    assert f"arms.{suffix}" in str(caught.value)


def test_doubled_worldbody_is_refused(description: RobotDescription, tmp_path: Path) -> None:
    """Pinocchio would build the robot twice."""
    text = description.model.read_text()
    (tmp_path / "g1.xml").write_text(text.replace("</worldbody>", "</worldbody><worldbody></worldbody>"))
    (tmp_path / "g1.toml").write_text(description.source.read_text())
    with pytest.raises(RobotError, match="exactly one <worldbody>"):
        Robot.load(load_description(tmp_path / "g1.toml"))


def test_hash_follows_the_files(make_robot: Callable[..., Path]) -> None:
    hashes = [
        Robot.load(load_description(make_robot(urdf, toml))).model_hash
        for urdf, toml in (
            (("", ""), ("", "")),
            (("", ""), ("0.02]", "0.03]")),
            (('mass value="1"', 'mass value="2"'), ("", "")),
            (("", ""), ("", "")),
        )
    ]
    assert len(set(hashes)) == 3
    assert hashes[0] == hashes[-1]
