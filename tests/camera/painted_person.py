"""A person of a few patches of exact depth, for rules that need no realism: what is seen, held, refused, rejoined."""

import numpy as np
from skinned_person import Array

from camera_client.calibration import TYPICAL
from camera_client.frame import Intrinsics, RgbdFrame
from camera_client.landmarks import COUNT, HIPS, SHOULDERS, TRACKED, WRISTS, Landmarks
from camera_client.surface import OFFSETS, SHOULDER_DROP
from camera_client.torso import R_FACING_CAMERA

WIDTH, HEIGHT = 640, 360
INTRINSICS = Intrinsics(515.0, 515.0, 319.5, 179.5)
WALL = 5000
"""Depth of the wall behind [mm]."""
ORIGIN = np.array([0.0, 0.15, 2.9])
"""Where the pelvis is, optical frame [m]."""
FPS = 30.0

DOWN = np.array([0.0, 0.0, -1.0])
FORWARD = np.array([1.0, 0.0, 0.0])
LEFT = np.array([0.0, 1.0, 0.0])

_SHOULDERS = np.array([[0.0, 0.175, 0.48], [0.0, -0.175, 0.48]])
_HIPS = np.array([[0.0, 0.11, 0.0], [0.0, -0.11, 0.0]])
_HALF = 7
_HAND, _HALF_HAND = 0.115, 4
"""How far a hand is beyond its wrist [m], and half of what is seen of it [pixel]."""


def limbs(left: tuple[Array, Array], right: tuple[Array, Array]) -> Array:
    """Unit directions of upper arm and forearm of both arms, shape (2, 2, 3)."""
    directions = np.array([left, right], dtype=float)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


HANGING = limbs((DOWN + 0.4 * LEFT, DOWN + 0.4 * LEFT + 0.2 * FORWARD), (DOWN - 0.4 * LEFT, DOWN - 0.4 * LEFT))
SPREAD = limbs((LEFT, LEFT), (-LEFT, -LEFT))
BENT = limbs((DOWN + 0.3 * LEFT, FORWARD + 0.3 * LEFT), (DOWN - 0.3 * LEFT, FORWARD - 0.3 * LEFT))
RAISED = limbs((LEFT, -DOWN), (-LEFT, -DOWN))


def body(directions: Array) -> Array:
    """Tracked joints in the pelvis frame, shape (8, 3) [m], of a typical operator."""
    arms = np.concatenate([_SHOULDERS[:, None], TYPICAL.lengths[..., None] * directions], axis=1).cumsum(axis=1)
    return np.concatenate([arms.reshape(6, 3), _HIPS])


def look(
    t: float, directions: Array, origin: Array = ORIGIN, hidden: tuple[int, ...] = (), hips: bool = True
) -> tuple[RgbdFrame, Landmarks]:
    """A frame and its landmarks; arms that are `hidden`, and hips that are, are out of view."""
    joints = body(directions) @ R_FACING_CAMERA + origin
    pixels = INTRINSICS.project(joints)
    pixels[SHOULDERS, 1] -= SHOULDER_DROP * INTRINSICS.fy / joints[SHOULDERS, 2]
    hands = joints[WRISTS] + _HAND * directions[:, 1] @ R_FACING_CAMERA
    patches = [(*at, z, _HALF) for at, z in zip(pixels, joints[:, 2] - OFFSETS, strict=True)]
    before = hands[:, 2] - OFFSETS[WRISTS]
    patches += [(*at, z, _HALF_HAND) for at, z in zip(INTRINSICS.project(hands), before, strict=True)]
    depth = np.full((HEIGHT, WIDTH), WALL, np.uint16)
    # The nearest surface is painted last.
    for x, y, z, half in sorted(patches, key=lambda patch: -patch[2]):
        column, row = round(x), round(y)
        area = slice(max(row - half, 0), max(row + half, 0)), slice(max(column - half, 0), max(column + half, 0))
        depth[area] = round(1000.0 * z)
    landmarks = Landmarks(np.full((COUNT, 2), np.nan), np.zeros(COUNT))
    landmarks.pixels[TRACKED] = pixels
    landmarks.visibility[TRACKED] = 0.99
    for arm in hidden:
        landmarks.visibility[TRACKED[3 * arm + 1 : 3 * arm + 3]] = 0.1
    if not hips:
        landmarks.visibility[TRACKED[HIPS]] = 0.1
    return RgbdFrame(t, depth, INTRINSICS), landmarks
