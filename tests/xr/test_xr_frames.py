"""Axes and wrists: against the seeds' constants, against Pinocchio, and against the rules of rigid transforms."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from xr_samples import pose, poses, vectors

from ik_client.rotation import turn
from xr_client.frames import (
    SEED_GRIP,
    T_ROBOT_OPENXR,
    T_WRIST_UNITREE,
    GripOffset,
    Side,
    hand_of_wrist,
    pose_of,
    quaternion_of,
    to_openxr,
    to_robot,
    wrist_of_grip,
    wrist_of_hand,
)

SIDES = st.sampled_from(list(Side))
MIRROR_XR = np.diag([-1.0, 1.0, 1.0, 1.0])
MIRROR_ROBOT = np.diag([1.0, -1.0, 1.0, 1.0])


def test_axes():
    """OpenXR right, up, back are the robot's -y, z, -x."""
    right, up, back = T_ROBOT_OPENXR[:3, :3].T
    np.testing.assert_array_equal(right, [0, -1, 0])
    np.testing.assert_array_equal(up, [0, 0, 1])
    np.testing.assert_array_equal(back, [-1, 0, 0])


def test_the_constants_are_the_seeds():
    np.testing.assert_array_equal(T_ROBOT_OPENXR, [[0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_array_equal(T_WRIST_UNITREE[0], [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_array_equal(T_WRIST_UNITREE[1], [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


@given(poses(), poses())
def test_changing_axes_is_a_homomorphism(A, B):
    """What is composed before is composed after, the identity and the inverse included."""
    np.testing.assert_allclose(to_robot(A @ B), to_robot(A) @ to_robot(B), atol=1e-12)
    np.testing.assert_allclose(to_robot(np.linalg.inv(A)), np.linalg.inv(to_robot(A)), atol=1e-12)
    np.testing.assert_array_equal(to_robot(np.eye(4)), np.eye(4))


@given(poses(), poses())
def test_changing_axes_keeps_distances_and_angles(A, B):
    a, b = to_robot(A), to_robot(B)
    assert np.linalg.norm(a[:3, 3] - b[:3, 3]) == pytest.approx(np.linalg.norm(A[:3, 3] - B[:3, 3]), abs=1e-12)
    assert turn(a[:3, :3], b[:3, :3]) == pytest.approx(turn(A[:3, :3], B[:3, :3]), abs=1e-7)
    assert np.linalg.det(a[:3, :3]) == pytest.approx(1.0)


@given(poses(), SIDES)
def test_there_and_back_is_exact(T, side):
    np.testing.assert_array_equal(to_openxr(to_robot(T)), T)
    np.testing.assert_array_equal(hand_of_wrist(wrist_of_hand(T, side), side), T)


@given(poses())
def test_left_and_right_mirror_each_other(T):
    """A hand mirrored through the body is a wrist mirrored through the body."""
    mirrored = MIRROR_XR @ T @ MIRROR_XR
    left, right = wrist_of_hand(T, Side.LEFT), wrist_of_hand(mirrored, Side.RIGHT)
    # The right wrist has its y axis out of the palm, the left out of the back: a mirrored y axis, as the robot has it.
    np.testing.assert_allclose(MIRROR_ROBOT @ left @ MIRROR_ROBOT, right, atol=1e-12)
    offset = GripOffset()
    grips = wrist_of_grip(T, offset), wrist_of_grip(mirrored, offset)
    np.testing.assert_allclose(MIRROR_ROBOT @ grips[0] @ MIRROR_ROBOT, grips[1], atol=1e-12)


@pytest.mark.parametrize("side", list(Side))
def test_a_hand_held_forward_with_the_thumb_up_is_the_robots_rest_pose(side):
    """Forearms level, palms facing each other, is q = 0: the robot's wrists are unturned there."""
    inward = 1.0 if side is Side.LEFT else -1.0  # the left palm faces right
    fingers, back = np.array([0.0, 0.0, -1.0]), np.array([-inward, 0.0, 0.0])
    T = np.eye(4)
    T[:3, 1], T[:3, 2] = back, -fingers
    T[:3, 0] = np.cross(T[:3, 1], T[:3, 2])
    np.testing.assert_allclose(wrist_of_hand(T, side)[:3, :3], np.eye(3), atol=1e-15)


def test_a_captured_hand_points_its_wrist_along_its_fingers(captured_hand):
    """Of a real hand: x of the wrist goes to the middle finger's knuckle, z to the thumb."""
    _, joints = captured_hand
    for side in Side:
        # The recordings are of one hand; its mirror image is the other.
        mirror = np.eye(4) if is_right(joints) == (side is Side.RIGHT) else MIRROR_XR
        wrist, knuckle, thumb = (wrist_of_hand(mirror @ joints[k] @ mirror, side) for k in (0, 11, 2))
        to_knuckle = wrist[:3, :3].T @ (knuckle[:3, 3] - wrist[:3, 3])
        to_thumb = wrist[:3, :3].T @ (thumb[:3, 3] - wrist[:3, 3])
        assert to_knuckle[0] > 0.9 * np.linalg.norm(to_knuckle)
        assert to_thumb[2] > 0.01


def is_right(joints) -> bool:
    """With fingers forward and the back of the hand up, the right hand's thumb is on the left."""
    return (joints[0, :3, :3].T @ (joints[2, :3, 3] - joints[0, :3, 3]))[0] < 0.0


def test_a_level_controller_has_its_wrist_behind_the_palm():
    """With a level forearm and the thumb up the handle points up by the tilt, and the wrist is unturned."""
    tilt, reach = math.radians(40.0), 0.08
    T_openxr_grip = pose((0.3, 1.0, -0.5), (tilt, 0.0, 0.0))
    wrist = wrist_of_grip(T_openxr_grip, GripOffset(tilt, reach))
    np.testing.assert_allclose(wrist[:3, :3], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(wrist[:3, 3], [0.5 - reach, -0.3, 1.0], atol=1e-12)


@given(poses())
def test_the_seeds_take_the_grip_for_the_wrist(T):
    np.testing.assert_array_equal(wrist_of_grip(T, SEED_GRIP), to_robot(T))


@given(vectors(10.0), st.tuples(*[st.floats(-1.0, 1.0)] * 4).map(np.array))
def test_poses_of_quaternions_are_pinocchios(position, quaternion_xyzw):
    pin = pytest.importorskip("pinocchio")
    norm = np.linalg.norm(quaternion_xyzw)
    assume(norm > 0.1)
    T = pose_of(position, quaternion_xyzw)
    np.testing.assert_allclose(T, pin.XYZQUATToSE3([*position, *quaternion_xyzw / norm]).homogeneous, atol=1e-12)
    again = quaternion_of(T[:3, :3])
    assert again[3] >= 0.0
    assert abs(again @ quaternion_xyzw) / norm == pytest.approx(1.0, abs=1e-12)


def test_a_half_turn_has_a_quaternion():
    for axis in np.eye(3):
        np.testing.assert_allclose(np.abs(quaternion_of(2.0 * np.outer(axis, axis) - np.eye(3))), [*axis, 0.0])
