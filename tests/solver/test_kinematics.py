"""Symbolic kinematics against Pinocchio's numbers."""

from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto.robots import load_description
from ik_service.chains import ArmChain
from ik_service.kinematics import gravity_torque, quaternion_of, rotation_error, waist_motion, wrist_pose
from ik_service.robot import Robot

unit_floats = st.floats(-1.0, 1.0)
vectors = st.tuples(unit_floats, unit_floats, unit_floats).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)


def _function(expressions: Callable[..., list[ca.SX]], *shapes: tuple[int, int]) -> Callable[..., list[np.ndarray]]:
    symbols = [ca.SX.sym(f"x{i}", *shape) for i, shape in enumerate(shapes)]
    function = ca.Function("f", symbols, expressions(*symbols))
    return lambda *values: [np.array(result) for result in function.call([ca.DM(value) for value in values])]


QUATERNION_OF = _function(lambda R: [quaternion_of(R)], (3, 3))


def _error(a: ca.SX, b: ca.SX) -> list[ca.SX]:
    error = rotation_error(a, b)
    return [error.angle, error.axis, error.curvature]


ROTATION_ERROR = _function(_error, (4, 1), (4, 1))


def _arms_of(robot: Robot) -> list[tuple[int, ArmChain, slice]]:
    split = len(robot.arms[0].joint_names)
    return [(0, robot.arms[0], slice(0, split)), (1, robot.arms[1], slice(split, None))]


def _check_wrist_pose(robot: Robot) -> None:
    for side, arm, part in _arms_of(robot):

        def expressions(q: ca.SX, arm: ArmChain = arm) -> list[ca.SX]:
            wrist = wrist_pose(arm, q)
            jacobian = ca.jacobian(wrist.p, q)
            return [wrist.p, wrist.R, wrist.quaternion, ca.horzcat(*wrist.levers), jacobian]

        evaluate = _function(expressions, (len(arm.joint_names), 1))
        for q in np.random.default_rng(3).uniform(robot.lower, robot.upper, (50, robot.nq)):
            p, R, quaternion, levers, jacobian = evaluate(q[part])
            T_base_wrist = robot.fk(q)[side]
            assert np.allclose(p.ravel(), T_base_wrist[:3, 3], atol=1e-12)
            assert np.allclose(R, T_base_wrist[:3, :3], atol=1e-12)
            w, x, y, z = quaternion.ravel()
            assert np.allclose(pin.Quaternion(w, x, y, z).toRotationMatrix(), T_base_wrist[:3, :3], atol=1e-12)
            assert np.allclose(levers, jacobian, atol=1e-12)


def test_wrist_pose_of_the_g1(robot: Robot) -> None:
    _check_wrist_pose(robot)


def test_wrist_pose_of_arms_with_skewed_axes(make_robot: Callable[..., Path]) -> None:
    """Arms of 4 and 5 joints, an axis along no coordinate, one negative, a rotated tool."""
    _check_wrist_pose(Robot.load(load_description(make_robot())))


@given(vectors, st.floats(-np.pi, np.pi))
def test_quaternion_of_any_rotation(axis: np.ndarray, angle: float) -> None:
    R = pin.exp3(angle * axis / np.linalg.norm(axis))
    w, x, y, z = QUATERNION_OF(R)[0].ravel()
    assert abs(np.linalg.norm([w, x, y, z]) - 1.0) < 1e-14
    assert np.allclose(pin.Quaternion(w, x, y, z).toRotationMatrix(), R, atol=1e-14)


@pytest.mark.parametrize("axis", [*np.eye(3), np.ones(3), [1, -1, 0], [0, 0.6, -0.8], [1e-9, 1, 0]])
@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 1.0, np.pi - 1e-6, np.pi - 1e-12, np.pi])
def test_rotation_error_at_every_angle(axis: list[float], angle: float) -> None:
    """Half a turn has two axes; either is right. Everywhere else the axis is unique."""
    unit = np.array(axis) / np.linalg.norm(axis)
    target = np.array([0.5, -0.5, 0.5, 0.5])
    wrist = pin.Quaternion(pin.exp3(angle * unit)) * pin.Quaternion(*target)
    x, y, z, w = wrist.coeffs()
    found, direction, curvature = (value.ravel() for value in ROTATION_ERROR(np.array([w, x, y, z]), target))
    assert found[0] == pytest.approx(angle, abs=1e-9)
    vector = found[0] * direction
    alternatives = [angle * unit, -angle * unit] if angle > np.pi - 1e-9 else [angle * unit]
    assert min(np.abs(vector - alternative).max() for alternative in alternatives) < 1e-9
    half = angle / 2.0
    expected = half / np.tan(half) if angle else 1.0
    assert curvature[0] == pytest.approx(expected, abs=1e-9)


@given(vectors, st.floats(0.01, 3.1), vectors, st.floats(-np.pi, np.pi))
def test_rotation_error_agrees_with_pinocchio(
    axis: np.ndarray, angle: float, target_axis: np.ndarray, target_angle: float
) -> None:
    R_target = pin.exp3(target_angle * target_axis / np.linalg.norm(target_axis))
    R = pin.exp3(angle * axis / np.linalg.norm(axis)) @ R_target
    found, direction, _ = ROTATION_ERROR(QUATERNION_OF(R)[0], QUATERNION_OF(R_target)[0])
    assert np.allclose(found[0] * direction.ravel(), pin.log3(R @ R_target.T), atol=1e-7)


def test_gravity_torque_agrees_with_pinocchio(robot: Robot) -> None:
    _compare_gravity_torques(robot)


def test_gravity_torque_of_a_tilted_base(make_robot: Callable[..., Path]) -> None:
    """A trunk that leans by 0.7 rad on a foot: the base frame is not upright, and gravity is not along its z."""
    lean = '<link name="foot"/><joint name="lean" type="fixed"><parent link="foot"/><child link="trunk"/>'
    lean += '<origin xyz="0 0 1" rpy="0.4 0.7 0"/></joint><link name="trunk"/>'
    robot = Robot.load(load_description(make_robot(('<link name="trunk"/>', lean))))
    assert not np.allclose(robot.arms[0].gravity, [0.0, 0.0, -9.81], atol=1.0)
    _compare_gravity_torques(robot)


def _compare_gravity_torques(robot: Robot) -> None:
    functions = [
        (part, arm.gravity, _function(lambda q, g, arm=arm: [gravity_torque(arm, q, g)], (arm.n, 1), (3, 1)))
        for _, arm, part in _arms_of(robot)
    ]
    rng = np.random.default_rng(5)
    for _ in range(200):
        q = rng.uniform(robot.lower, robot.upper)
        expected = robot.gravity_torque(q)
        for part, gravity, function in functions:
            assert np.allclose(function(q[part], gravity)[0].ravel(), expected[part], rtol=0.0, atol=1e-12)


def test_waist_motion_agrees_with_pinocchio(robot: Robot) -> None:
    """Whatever the arms do, a bent waist carries the wrists along as one rigid body; gravity turns the other way."""
    motion = _function(lambda w: list(waist_motion(robot.waist, w)), (3, 1))
    torques = [_function(lambda q, g, arm=arm: [gravity_torque(arm, q, g)], (7, 1), (3, 1)) for arm in robot.arms]
    rng = np.random.default_rng(6)
    for _ in range(100):
        q, waist = rng.uniform(robot.lower, robot.upper), rng.uniform(-1.5, 1.5, 3)
        R, p = motion(waist)
        T = np.block([[R, p.reshape(3, 1)], [np.zeros((1, 3)), np.ones((1, 1))]])
        assert np.allclose(T, robot.waist.motion(waist), rtol=0.0, atol=1e-12)
        for straight, bent in zip(robot.fk(q), robot.fk(q, waist), strict=True):
            assert np.allclose(T @ straight, bent, rtol=0.0, atol=1e-12)
        expected = robot.gravity_torque(q, waist)
        for torque, part in zip(torques, (slice(0, 7), slice(7, 14)), strict=True):
            found = torque(q[part], R.T @ robot.arms[0].gravity)[0].ravel()
            assert np.allclose(found, expected[part], rtol=0.0, atol=1e-12)
    assert np.allclose(motion(np.zeros(3))[0], np.eye(3), rtol=0.0, atol=1e-15)


def test_without_a_waist_nothing_moves(make_robot: Callable[..., Path]) -> None:
    robot = Robot.load(load_description(make_robot()))
    R, p = _function(lambda w: list(waist_motion(robot.waist, w)), (0, 1))(np.zeros(0))
    assert np.array_equal(R, np.eye(3))
    assert np.array_equal(p.ravel(), np.zeros(3))
