"""Without depth: the pose model's body is put where it fits the picture, and the estimate says that it is a guess."""

from dataclasses import replace

import numpy as np
import pytest
from painted_person import BENT, FPS, HANGING, INTRINSICS, RAISED, SPREAD, body, look

from camera_client.calibration import TYPICAL
from camera_client.chain import Chain
from camera_client.frame import RgbdFrame
from camera_client.landmarks import COUNT, TRACKED, Landmarks
from camera_client.monocular import model_depths
from camera_client.t_pose import TPose
from camera_client.torso import R_FACING_CAMERA


def blind(t: float, directions: np.ndarray, size: float = 1.0, **kwargs) -> tuple[RgbdFrame, Landmarks]:
    """A frame in colour only, and landmarks with a model's body of another size."""
    frame, landmarks = look(t, directions, **kwargs)
    colour = np.zeros((*frame.size[::-1], 3), np.uint8)
    world = np.full((COUNT, 3), np.nan)
    world[TRACKED] = size * body(directions) @ R_FACING_CAMERA
    return replace(frame, depth=None, colour=colour), replace(landmarks, world=world)


@pytest.mark.parametrize("directions", [HANGING, SPREAD, BENT, RAISED], ids=["hanging", "spread", "bent", "raised"])
@pytest.mark.parametrize("size", [0.8, 1.2])
def test_a_true_body_of_any_size_gives_true_arms(directions, size):
    chain = Chain(TYPICAL)
    for k in range(30):
        estimate = chain.update(*blind(k / FPS, directions, size))
    assert estimate is not None
    assert estimate.monocular
    assert estimate.tracked.all()
    assert np.degrees(np.arccos((estimate.limbs * directions).sum(axis=-1).clip(-1.0, 1.0))).max() < 8.0


def test_distance_is_found_from_size_in_the_picture():
    for z in (1.8, 2.5, 3.5):
        frame, landmarks = blind(0.0, SPREAD, 1.1, origin=np.array([0.1, 0.2, z]))
        depths = model_depths(landmarks, landmarks.seen(*frame.size), INTRINSICS, TYPICAL)
        assert depths is not None
        assert np.abs(depths - z).max() < 0.06 * z


def test_depth_is_preferred_and_said():
    estimate = Chain(TYPICAL).update(*look(0.0, BENT))
    assert estimate is not None
    assert not estimate.monocular


def test_without_depth_and_without_a_body_arms_are_held():
    chain = Chain(TYPICAL)
    chain.update(*blind(0.0, BENT))
    frame, landmarks = blind(0.1, BENT)
    held = chain.update(frame, replace(landmarks, world=None))
    assert held is not None
    assert not held.tracked.any()


def test_lengths_are_not_calibrated_without_depth():
    pose = TPose()
    assert not pose.add(*blind(0.0, SPREAD))
    assert "depth camera" in pose.fault


def test_a_frame_of_nothing_is_refused():
    with pytest.raises(ValueError, match="needs depth or colour"):
        RgbdFrame(0.0, None, INTRINSICS)
    with pytest.raises(ValueError, match="does not belong"):
        RgbdFrame(0.0, np.zeros((4, 5), np.uint16), INTRINSICS, np.zeros((5, 4, 3), np.uint8))
