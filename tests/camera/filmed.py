"""Films rendered people into recordings: colour, an OAK's noisy depth, and when the hold-to-run switch is held."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from choreography import Choreography
from oak_noise import OakNoise
from rendered_person import HEIGHT, INTRINSICS, WIDTH, RenderedPerson
from skinned_person import Array

from camera_client.frame import RgbdFrame
from camera_client.writer import Writer

FPS = 30.0
_MARGIN = 45
"""Pixels around the joints that depth is measured of; it is unknown elsewhere."""

MIRROR = Choreography(
    keys=(
        (0.0, "hang", "hang"),
        (1.5, "hang", "hang"),
        (2.5, "T", "T"),
        (5.5, "T", "T"),
        (6.5, "reach", "reach"),
        (9.5, "reach", "reach"),
        (10.5, "hang", "hang"),
        (11.5, "hang", "raised"),
        (14.5, "hang", "raised"),
        (15.5, "hang", "hang"),
        (16.0, "hang", "hang"),
    ),
    wave=(0.0, 0.0),
    turn=(0.0, 0.0),
)
"""16 s of what everybody tries first: a T pose, both arms forward, the right arm up; three seconds each."""

HOLDS = {"T": (3.5, 5.5), "reach": (7.5, 9.5), "raised": (12.5, 14.5)}
"""When the arms have been still for a second and still are, by posture, in `MIRROR` [s]."""


def film(
    path: Path,
    scene: RenderedPerson,
    dance: Choreography,
    held: Callable[[float], bool | None] = lambda t: None,
    *,
    fps: float = FPS,
    with_depth: bool = True,
    seed: int = 0,
) -> Path:
    """Record a choreography, about 25 frames a second.

    Args:
        path: The recording; there must be none yet.
        scene: Who dances.
        dance: What they dance.
        held: Whether the switch is held at a time [s].
        fps: Frames a second.
        with_depth: Whether the camera measures depth.
        seed: Of the noise of depth.

    Returns:
        The recording. Its frames have the times of the choreography.
    """
    noise = OakNoise(np.random.default_rng(seed))
    writer = Writer(path, "a rendered person")
    for k in range(round(dance.duration * fps)):
        t = k / fps
        writer.write(k, shot(scene, dance, t, noise if with_depth else None), held(t))
    writer.close()
    return path


def shot(scene: RenderedPerson, dance: Choreography, t: float, noise: OakNoise | None = None) -> RgbdFrame:
    """One frame of it; without noise it has no depth."""
    R, p = posed(scene, dance, t)
    colour, depth = scene.render(R, p)
    measured = None
    if noise is not None:
        pixels = INTRINSICS.project(scene.in_camera(scene.person.joints(p)))
        (left, top), (right, bottom) = pixels.min(axis=0) - _MARGIN, pixels.max(axis=0) + _MARGIN
        measured = noise(depth, (max(int(top), 0), min(int(bottom), HEIGHT), max(int(left), 0), min(int(right), WIDTH)))
    return RgbdFrame(t, measured, INTRINSICS, np.ascontiguousarray(colour))


def posed(scene: RenderedPerson, dance: Choreography, t: float) -> tuple[Array, Array]:
    """Rotations and positions of the bones at a time [s]."""
    u, f, yaw, sway = dance.at(t)
    return scene.person.pose(u, f, yaw, np.array([0.0, 0.0, scene.person.height]) + sway)
