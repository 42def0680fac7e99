"""The pelvis frame: a rotation in the right sense, upright under any tilt, turned with the body, hips seen or not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from painted_person import HANGING, body
from skinned_person import rotation_about

from camera_client.calibration import TYPICAL
from camera_client.landmarks import HIPS
from camera_client.torso import R_FACING_CAMERA, Torso, level_rotation, turned

UP, ALL = np.array([0.0, 0.0, 1.0]), np.ones(8, dtype=bool)
THESIS = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

angles = st.floats(-0.6, 0.6)


def seen(yaw: float, R_level_camera: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Joints of a hanging person turned by a yaw, in the optical frame."""
    return body(HANGING) @ rotation_about(UP, yaw).T @ R_level_camera + origin


def test_axes_are_a_rotation_and_the_published_ones_a_reflection():
    assert np.linalg.det(R_FACING_CAMERA) == pytest.approx(1.0)
    assert np.linalg.det(THESIS) == pytest.approx(-1.0)
    above, towards, right = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])
    assert (R_FACING_CAMERA @ above == (0.0, 0.0, 1.0)).all()
    assert (R_FACING_CAMERA @ towards == (1.0, 0.0, 0.0)).all()
    # A picture that is not mirrored shows the person's left on its right.
    assert (R_FACING_CAMERA @ right == (0.0, 1.0, 0.0)).all()
    assert (THESIS @ above == (0.0, 0.0, -1.0)).all()


@given(pitch=angles, roll=angles)
def test_tilt_is_taken_out(pitch, roll):
    tilt = rotation_about(np.array([0.0, 1.0, 0.0]), pitch) @ rotation_about(np.array([1.0, 0.0, 0.0]), roll)
    up_camera = R_FACING_CAMERA.T @ tilt @ UP
    R = level_rotation(3.0 * up_camera)
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert np.allclose(R @ up_camera, UP, atol=1e-9)


@given(yaw=st.floats(-1.2, 1.2), pitch=angles)
def test_joints_come_back_in_the_pelvis_frame(yaw, pitch):
    up_camera = R_FACING_CAMERA.T @ rotation_about(np.array([0.0, 1.0, 0.0]), pitch) @ UP
    R, origin = level_rotation(up_camera), np.array([0.3, 0.2, 2.5])
    frame = Torso(R, TYPICAL.hips_below).update(seen(yaw, R, origin), ALL, 0.0)
    assert frame.yaw == pytest.approx(turned(yaw))
    assert np.allclose(frame.points(seen(turned(yaw), R, origin)), body(HANGING), atol=1e-9)
    assert np.allclose(frame.directions(np.eye(3)), frame.R_pelvis_camera.T)


def test_a_round_trunk_shows_a_part_of_a_turn():
    assert turned(0.085) == pytest.approx(0.1, rel=0.01)
    assert turned(0.07, shown=0.7) == pytest.approx(0.1, rel=0.01)
    assert turned(np.pi) == pytest.approx(np.pi)
    assert (np.diff([turned(yaw, 0.6) for yaw in np.linspace(-np.pi, np.pi, 200)]) > 0.0).all()


def test_the_front_of_the_trunk_counts_where_a_shoulder_is_covered():
    joints, yaw = seen(0.0, R_FACING_CAMERA, np.zeros(3)), []
    # The left shoulder seems 12 cm nearer, because the arm is before it.
    joints[0, 2] -= 0.12
    for sure, front in ((np.ones(2), np.nan), (np.array([0.0, 1.0]), np.nan), (np.array([0.0, 1.0]), 0.0)):
        yaw.append(Torso(R_FACING_CAMERA, TYPICAL.hips_below).update(joints, ALL, 0.0, sure, front).yaw)
    assert abs(yaw[0]) > np.radians(2.0)
    assert np.allclose(yaw[1:], 0.0, atol=1e-9)


def test_yaw_is_low_passed_and_follows():
    torso, rng, errors = Torso(R_FACING_CAMERA, TYPICAL.hips_below), np.random.default_rng(0), []
    for k in range(150):
        yaw = np.radians(25.0) * np.sin(2.0 * np.pi * k / 90.0)
        # What is seen of a turn is a part of it; the filter is what is looked at here.
        noisy = yaw + np.radians(5.0) * rng.standard_normal()
        errors.append(torso.update(seen(noisy, R_FACING_CAMERA, np.zeros(3)), ALL, 1.0 / 30.0).yaw - turned(yaw))
    assert np.degrees(np.std(errors[30:])) < 4.0


def test_yaw_passes_the_back():
    torso = Torso(R_FACING_CAMERA, TYPICAL.hips_below)
    for degrees in range(0, 360, 2):
        seeming = np.remainder(np.radians(degrees) + np.pi, 2.0 * np.pi) - np.pi
        frame = torso.update(seen(seeming, R_FACING_CAMERA, np.zeros(3)), ALL, 1.0 / 30.0)
        off = np.degrees(np.remainder(frame.yaw - turned(seeming) + np.pi, 2.0 * np.pi) - np.pi)
        assert abs(off) < 12.0


def test_hips_out_of_view_are_guessed_without_a_jump():
    torso, origin = Torso(R_FACING_CAMERA, TYPICAL.hips_below), np.array([0.0, 0.1, 2.9])
    joints = seen(0.2, R_FACING_CAMERA, origin)
    # This operator's hips are 4 cm lower than calibrated.
    joints[HIPS, 1] += 0.04
    for _ in range(90):
        last = torso.update(joints, ALL, 1.0 / 30.0).origin
    without = ALL.copy()
    without[HIPS] = False
    joints[HIPS] = 77.0
    for _ in range(30):
        now = torso.update(joints, without, 1.0 / 30.0).origin
        assert np.linalg.norm(now - last) < 0.01
        last = now
    assert np.allclose(last, origin + np.array([0.0, 0.04, 0.0]), atol=0.01)


def test_hips_never_seen_are_where_they_were_calibrated():
    without = ALL.copy()
    without[HIPS] = False
    joints = seen(0.5, R_FACING_CAMERA, np.array([0.0, 0.1, 2.9]))
    frame = Torso(R_FACING_CAMERA, TYPICAL.hips_below).update(joints, without, 0.0)
    assert np.allclose(frame.origin, (0.0, 0.1, 2.9), atol=1e-9)
