"""Which bodies are credible, which joints are seen, and how pixels and rays belong together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from painted_person import HANGING, HEIGHT, INTRINSICS, WIDTH, look

from camera_client.landmarks import TRACKED, Landmark

SIZE = (WIDTH, HEIGHT)


def test_a_person_is_credible():
    _, landmarks = look(0.0, HANGING)
    assert landmarks.credible(*SIZE)
    assert landmarks.seen(*SIZE).all()


def test_hips_may_be_missing_and_shoulders_may_not():
    _, landmarks = look(0.0, HANGING, hips=False)
    assert landmarks.credible(*SIZE)
    landmarks.visibility[Landmark.LEFT_SHOULDER] = 0.4
    assert not landmarks.credible(*SIZE)


@pytest.mark.parametrize("pixel", [(-1.0, 50.0), (50.0, HEIGHT + 0.0), (np.nan, 50.0), (50.0, np.inf)])
def test_what_is_out_of_the_picture_is_not_seen(pixel):
    _, landmarks = look(0.0, HANGING)
    landmarks.pixels[Landmark.LEFT_WRIST] = pixel
    assert landmarks.seen(*SIZE).tolist() == [j != 2 for j in range(8)]
    assert landmarks.credible(*SIZE)


def test_a_body_upside_down_or_tiny_is_none():
    _, landmarks = look(0.0, HANGING)
    landmarks.pixels[:, 1] = HEIGHT - 1 - landmarks.pixels[:, 1]
    assert not landmarks.credible(*SIZE)
    _, landmarks = look(0.0, HANGING, np.array([0.0, 0.0, 40.0]))
    assert not landmarks.credible(*SIZE)


def test_tracked_joints_are_the_arms_from_the_shoulder_out_and_the_hips():
    assert [Landmark(number).name for number in TRACKED] == [
        *(f"LEFT_{joint}" for joint in ("SHOULDER", "ELBOW", "WRIST")),
        *(f"RIGHT_{joint}" for joint in ("SHOULDER", "ELBOW", "WRIST")),
        "LEFT_HIP",
        "RIGHT_HIP",
    ]


@given(x=st.floats(-2, 2), y=st.floats(-2, 2), z=st.floats(0.3, 8))
def test_rays_go_back_to_their_points(x, y, z):
    point = np.array([x, y, z])
    ray = INTRINSICS.rays(INTRINSICS.project(point))
    assert ray[2] == 1.0
    assert np.allclose(ray * z, point)
