"""The turn of the front of a trunk: exact for a plane, in spite of noise, holes and an arm before it."""

import math

import numpy as np
import pytest
from choreography import Choreography
from painted_person import INTRINSICS
from rendered_person import RenderedPerson
from sequence import moment

from camera_client.landmarks import HIPS, SHOULDERS
from camera_client.trunk_plane import trunk_turn

CORNERS = np.array([[355.0, 120.0], [285.0, 120.0], [340.0, 205.0], [300.0, 205.0]])


def board(turn: float, rng: np.random.Generator | None = None) -> np.ndarray:
    """Depth picture of a plane at 2.9 m whose left, on the picture's right, is further away by a turn."""
    columns = (np.arange(640) - 320.0) / INTRINSICS.fx
    # z = 2.9 + tan(turn) x with x = column z.
    z = np.tile(2.9 / (1.0 - math.tan(turn) * columns), (360, 1))
    if rng is not None:
        z = z + 0.025 * rng.standard_normal(z.shape)
    return np.rint(1000.0 * z).astype(np.uint16)


@pytest.mark.parametrize("degrees", [-30.0, -10.0, 0.0, 10.0, 30.0])
def test_a_plane_is_seen_as_it_is(degrees):
    seen = trunk_turn(board(math.radians(degrees)), CORNERS, INTRINSICS)
    assert math.degrees(seen) == pytest.approx(degrees, abs=1.5)


def test_noise_holes_and_an_arm_do_not_turn_it():
    rng = np.random.default_rng(0)
    seen = []
    for _ in range(50):
        depth = board(0.0, rng)
        depth[rng.random(depth.shape) < 0.2] = 0
        # A forearm across the belly, 15 cm before it, on one side.
        depth[160:180, 320:400] = 2750
        seen.append(math.degrees(trunk_turn(depth, CORNERS, INTRINSICS)))
    assert abs(np.mean(seen)) < 1.0
    assert np.std(seen) < 2.5


def test_too_little_says_nothing():
    depth = np.zeros((360, 640), np.uint16)
    assert math.isnan(trunk_turn(depth, CORNERS, INTRINSICS))
    hidden = CORNERS.copy()
    hidden[2] = np.nan
    assert math.isnan(trunk_turn(board(0.0), hidden, INTRINSICS))


@pytest.mark.parametrize("degrees", [-20.0, 20.0])
def test_a_rendered_person_turns_in_the_right_sense(scene: RenderedPerson, degrees: float):
    still = Choreography(((0.0, "T", "T"), (4.0, "T", "T")), turn=(0.0, 4.0), turn_angle=math.radians(degrees))
    angles = []
    for t in (0.0, 1.0):
        now = moment(scene, still, t)
        corners = INTRINSICS.project(now.in_camera[[*SHOULDERS, *HIPS]])
        angles.append(trunk_turn(np.rint(1000.0 * np.minimum(now.depth, 9.0)).astype(np.uint16), corners, INTRINSICS))
    # A front that is round shows a part of it.
    assert 0.35 < math.degrees(angles[1] - angles[0]) / degrees < 1.0
