"""What the robot's eyes see, drawn fast: the same as MuJoCo draws of the whole scene, only without what is not seen."""

import io
from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image

from sim_client.eye_camera import HEIGHT, WIDTH, EyeCamera
from sim_client.gl import NoRendering, find_backend
from sim_client.robot import SimRobot
from sim_client.scene import build_scene


@pytest.fixture(scope="module")
def home(g1) -> np.ndarray:
    return SimRobot(g1).data.qpos.copy()


@pytest.fixture(scope="module")
def camera(g1) -> Iterator[EyeCamera]:
    try:
        backend = find_backend()
    except NoRendering as fault:
        pytest.skip(str(fault))
    made = EyeCamera(build_scene(g1), backend)
    yield made
    made.close()


def forward(camera: EyeCamera, home: np.ndarray, elbow: float = 0.3) -> np.ndarray:
    """Both arms held out before the robot."""
    qpos = home.copy()
    for side in ("left", "right"):
        qpos[camera._model.joint(f"{side}_shoulder_pitch_joint").qposadr] = -0.7
        qpos[camera._model.joint(f"{side}_elbow_joint").qposadr] = elbow
    return qpos


def eyes_of(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return picture[:, :WIDTH].astype(int), picture[:, WIDTH:].astype(int)


def dark(eye: np.ndarray) -> np.ndarray:
    """Where the hands are: nothing else before the robot is dark."""
    return eye.max(axis=2) < 70


def test_the_hands_are_seen_by_both_eyes_and_nearer_things_farther_apart(camera, home):
    """The left eye, 40 mm to the left, sees a hand farther to the right: by the parallax of its distance."""
    left, right = eyes_of(camera.render(forward(camera, home)))
    assert left.shape == right.shape == (HEIGHT, WIDTH, 3)
    for hand in (slice(0, WIDTH // 2), slice(WIDTH // 2, WIDTH)):
        # Above the forearms, where only the hands are dark.
        columns = [np.nonzero(dark(eye)[:330, hand])[1] for eye in (left, right)]
        shift = float(columns[0].mean() - columns[1].mean())
        # Hands are 0.3 to 0.6 m before the eyes; the focal length of 60 degrees over 480 pixels is 416 pixels.
        assert 0.04 * 416 / 0.6 < shift < 0.04 * 416 / 0.3
    assert camera.fov_deg == 60.0


def test_a_picture_changes_with_the_arms(camera, home):
    first = camera.render(forward(camera, home)).copy()
    again = camera.render(forward(camera, home)).copy()
    bent = camera.render(forward(camera, home, elbow=0.5)).copy()
    np.testing.assert_array_equal(first, again)
    assert (first != bent).any(axis=2).mean() > 0.01


def drawn_with_bounds(camera: EyeCamera, qpos: np.ndarray, radius: float) -> np.ndarray:
    """Draw as if every geom had a bounding sphere of this radius."""
    bounds = camera._model.geom_rbound
    kept = bounds.copy()
    bounds[:] = np.where(kept > 0.0, radius, kept)
    picture = camera.render(qpos).copy()
    bounds[:] = kept
    return picture


def test_what_is_left_out_would_not_be_seen(camera, g1, home):
    """Oracle: MuJoCo's drawing of everything, which bounds as large as the world amount to.

    Negative control: with bounds that are too small, parts vanish that should be seen.
    """
    joints = [camera._model.joint(name) for name in (*g1.arm_joints, *g1.waist)]
    addresses = [int(joint.qposadr[0]) for joint in joints]
    lower, upper = 0.6 * np.array([joint.range for joint in joints]).T
    rng, vanished = np.random.default_rng(5), 0
    for _ in range(6):
        qpos = home.copy()
        qpos[addresses] = rng.uniform(lower, upper)
        fast, drawn = camera.render(qpos).copy(), camera._scene.ngeom
        np.testing.assert_array_equal(fast, drawn_with_bounds(camera, qpos, 1e3))
        assert drawn < 0.8 * camera._scene.ngeom
        vanished += bool((fast != drawn_with_bounds(camera, qpos, 1e-6)).any())
    assert vanished


def test_the_pictures_are_jpeg(camera, home):
    pair = camera.take(forward(camera, home))
    drawn = eyes_of(camera.render(forward(camera, home)))
    for data, expected in zip(pair, drawn, strict=True):
        image = Image.open(io.BytesIO(data))
        assert (image.format, image.size) == ("JPEG", (WIDTH, HEIGHT))
        assert np.abs(np.asarray(image).astype(int) - expected).mean() < 3.0
        assert len(data) < 60_000
