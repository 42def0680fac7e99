"""Calibration: a T pose gives an operator's lengths, the implausible is refused, and files are checked."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from painted_person import FPS, HANGING, SPREAD, look
from skinned_person import rotation_about

from camera_client.calibration import TYPICAL, Calibration, CalibrationError, default_folder, load, save
from camera_client.surface import LEAN
from camera_client.t_pose import LEAST_FRAMES, TPose


def posed(directions: np.ndarray = SPREAD, frames: int = LEAST_FRAMES + 5, sway: float = 0.0) -> TPose:
    pose = TPose()
    for k in range(frames):
        origin = np.array([sway * np.sin(0.5 * k), 0.15, 2.9])
        pose.add(*look(k / FPS, directions, origin))
    return pose


def test_a_t_pose_gives_the_operator():
    fitted = posed().finish()
    # A depth picture is in millimetres and a pixel is 6 mm wide.
    assert np.allclose(fitted.lengths, TYPICAL.lengths, atol=0.005)
    # Shoulders and hips of this person are in one plane; of one who stands upright they are not.
    lean = np.array([0.0, -1.0, LEAN]) / np.hypot(1.0, LEAN)
    assert np.allclose(fitted.up_camera, lean, atol=0.01)
    trunk = TYPICAL.hips_below[2] * np.array([LEAN, 0.0, 1.0]) / np.hypot(1.0, LEAN)
    assert np.allclose(fitted.hips_below, trunk, atol=0.01)
    assert abs(fitted.front) < 0.02


def test_a_tilt_that_is_known_is_taken():
    up = np.array([0.0, -np.cos(0.1), -np.sin(0.1)])
    fitted = posed().finish(2.0 * up)
    assert np.allclose(fitted.up_camera, up, atol=1e-9)
    # The trunk, which is square to the view, leans back then.
    assert fitted.hips_below[0] == pytest.approx(TYPICAL.hips_below[2] * np.sin(0.1) * -1.0, abs=0.01)


def test_other_postures_do_not_count():
    pose = posed(HANGING)
    assert pose.good == 0
    assert "stretch both arms out" in pose.fault
    with pytest.raises(CalibrationError, match=f"only 0 of {LEAST_FRAMES} frames showed a T pose: stretch both arms"):
        pose.finish()


def test_what_is_missing_is_said():
    pose = TPose()
    frame, landmarks = look(0.0, SPREAD)
    assert not pose.add(frame, None)
    assert pose.fault == "nobody faces the camera"
    assert not pose.add(*look(0.0, SPREAD, hips=False))
    assert "step back" in pose.fault
    frame.depth[:] = 0
    assert not pose.add(frame, landmarks)
    assert "no depth on the body" in pose.fault


def test_an_operator_who_moves_is_refused():
    with pytest.raises(CalibrationError, match=r"you moved by .* cm: hold the T pose still"):
        posed(sway=0.15).finish()


def test_too_few_frames_are_refused():
    with pytest.raises(CalibrationError, match="only 3 of"):
        posed(frames=3).finish()


@pytest.mark.parametrize(
    ("lengths", "words"),
    [
        ([[0.10, 0.25], [0.10, 0.25]], "left upper arm seems to be 0.10 m long"),
        ([[0.29, 0.25], [0.29, 0.40]], "right forearm seems to be 0.40 m long"),
        ([[0.25, 0.25], [0.32, 0.25]], "upper arms seem to differ, 0.25 m left and 0.32 m right"),
        ([[0.29, np.nan], [0.29, 0.25]], "not .* finite numbers"),
    ],
)
def test_the_implausible_is_refused(lengths, words):
    with pytest.raises(CalibrationError, match=words):
        Calibration(np.array(lengths), TYPICAL.hips_below, TYPICAL.up_camera)


def test_hips_above_the_shoulders_are_refused():
    with pytest.raises(CalibrationError, match=r"hips seem to be -0\.40 m below"):
        Calibration(TYPICAL.lengths, np.array([0.0, 0.0, 0.4]), TYPICAL.up_camera)


@given(pitch=st.floats(-0.4, 0.4))
def test_the_tilt_is_a_rotation(pitch):
    up = rotation_about(np.array([1.0, 0.0, 0.0]), pitch) @ TYPICAL.up_camera
    R = Calibration(TYPICAL.lengths, TYPICAL.hips_below, up).level_rotation()
    assert np.allclose(R @ up, (0.0, 0.0, 1.0))
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_it_is_kept_per_user(tmp_path):
    folder = tmp_path / "new" / "folder"
    fitted = posed().finish()
    path = save(fitted, "ann", folder)
    save(TYPICAL, "bob", folder)
    again = load("ann", folder)
    assert (again.lengths == fitted.lengths).all()
    assert (again.hips_below == fitted.hips_below).all()
    assert (again.up_camera == fitted.up_camera).all()
    assert sorted(file.name for file in folder.iterdir()) == ["ann.json", "bob.json"]
    assert path == folder / "ann.json"


@pytest.mark.parametrize("user", ["", "../ann", "a/b", ".hidden", "x" * 65, "ann\n"])
def test_a_user_is_no_path(user, tmp_path):
    for use in (lambda: save(TYPICAL, user, tmp_path), lambda: load(user, tmp_path)):
        with pytest.raises(CalibrationError, match="is no user name"):
            use()
    assert not list(tmp_path.iterdir())


def test_an_unknown_user_is_told_what_to_do(tmp_path):
    with pytest.raises(CalibrationError, match="run ik-camera calibrate --user ann"):
        load("ann", tmp_path)


GOOD = {"lengths": [[0.29, 0.25], [0.29, 0.25]], "hips_below": [0, 0, -0.48], "up_camera": [0, -1, 0]}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "null",
        "{}",
        json.dumps({**GOOD, "lengths": [[9, 9], [9, 9]]}),
        json.dumps({**GOOD, "lengths": "long"}),
        json.dumps({**GOOD, "up_camera": [0, 0, 0]}),
        json.dumps({**GOOD, "hips_below": [0, 0]}),
        '{"lengths": [[NaN, 0.25], [0.29, 0.25]], "hips_below": [0, 0, -0.48], "up_camera": [0, -1, 0]}',
        "\xff",
    ],
)
def test_a_broken_file_is_one_line(text, tmp_path):
    (tmp_path / "ann.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(CalibrationError) as caught:
        load("ann", tmp_path)
    assert str(tmp_path / "ann.json") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_are_with_the_users_settings(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert default_folder() == tmp_path / "ik-camera"
    monkeypatch.delenv("XDG_CONFIG_HOME")
    assert default_folder().parts[-2:] == (".config", "ik-camera")
