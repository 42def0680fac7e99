"""Rendered dances with what a pose model found in them, kept in files, so that a chain can be tried without rendering.

A file holds no colour: exact depth around the person, landmarks as they were found, and the true joints.
"""

import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from choreography import Choreography
from numpy.typing import NDArray
from rendered_person import HEIGHT, WIDTH, RenderedPerson
from sequence import FPS, Moment, moment_with_colour, pixels_at
from skinned_person import Person
from subjects import Subject, Take

from camera_client.landmarks import COUNT, TRACKED, Landmarks

Detect = Callable[[NDArray[np.uint8], float], Landmarks | None]
"""A pose model: colour and the time of the capture [s]."""

_FAR = 9.0
"""No camera measures beyond it [m]."""


class Material:
    """A rendered dance.

    Attributes:
        dance: What was danced.
        landmarks: What the model found in each frame.
    """

    def __init__(self, file: Path, dance: Choreography) -> None:
        """Open a file of `render`.

        Raises:
            OSError: There is none.
        """
        data = np.load(file)
        self.dance = dance
        self._blob, self._ends = data["depth"], data["ends"]
        self._box: list[int] = data["box"].tolist()
        self._in_camera, self._in_pelvis = data["in_camera"], data["in_pelvis"]
        self.landmarks = [
            _spread(*parts) for parts in zip(data["pixels"], data["visibility"], data["world"], strict=True)
        ]

    def moments(self) -> Iterator[Moment]:
        """What is true, frame by frame."""
        begin = 0
        top, bottom, left, right = self._box
        for k, end in enumerate(self._ends.tolist()):
            depth = np.full((HEIGHT, WIDTH), _FAR, np.float32)
            crop = np.frombuffer(zlib.decompress(self._blob[begin:end].tobytes()), np.uint16)
            depth[top:bottom, left:right] = crop.reshape(bottom - top, right - left) * 1e-3
            begin = end
            yield Moment(k / FPS, depth, self._in_camera[k], self._in_pelvis[k])


def render(take: Take, mesh: Path, detect: Detect, file: Path, told: Callable[[], object] = lambda: None) -> None:
    """Render a dance, show it to a pose model, and keep it.

    Args:
        take: What is danced by whom.
        mesh: Folder with the mesh and the texture of a person.
        detect: The pose model, which has seen nothing yet.
        file: Where to.
        told: Called after every frame.

    Raises:
        sim_client.gl.NoRendering: This machine cannot render.
    """
    subject, rng = take.subject, take.rng()
    frames = round(take.dance.duration * FPS)
    person = Person(mesh / "human.npz", subject.stretch)
    scene = RenderedPerson(person, mesh / "human.png", subject.camera, subject.pitch)
    found: list[Landmarks | None] = []
    blobs, in_camera, in_pelvis = [], [], []
    box = _box(scene, take.dance, frames)
    top, bottom, left, right = box
    try:
        for k in range(frames):
            now, colour = moment_with_colour(scene, take.dance, k / FPS)
            found.append(detect(exposed(colour, subject, rng), k / FPS))
            crop = np.rint(1000.0 * np.minimum(now.depth[top:bottom, left:right], _FAR)).astype(np.uint16)
            blobs.append(zlib.compress(crop.tobytes(), 1))
            in_camera.append(now.in_camera)
            in_pelvis.append(now.in_pelvis)
            told()
    finally:
        scene.close()
    partial = file.with_suffix(".partial.npz")
    np.savez(
        partial,
        depth=np.frombuffer(b"".join(blobs), np.uint8),
        ends=np.cumsum([len(blob) for blob in blobs]),
        box=np.array(box),
        in_camera=np.array(in_camera),
        in_pelvis=np.array(in_pelvis),
        pixels=np.array([np.full((8, 2), np.nan) if one is None else one.pixels[TRACKED] for one in found]),
        visibility=np.array([np.zeros(8) if one is None else one.visibility[TRACKED] for one in found]),
        world=np.array(
            [np.full((8, 3), np.nan) if one is None or one.world is None else one.world[TRACKED] for one in found]
        ),
    )
    partial.replace(file)


def exposed(colour: NDArray[np.uint8], subject: Subject, rng: np.random.Generator) -> NDArray[np.uint8]:
    """A rendered picture as a camera takes it."""
    noisy = subject.gain * colour + subject.grain * rng.standard_normal(colour.shape, np.float32)
    return np.ascontiguousarray(noisy.clip(0.0, 255.0).astype(np.uint8))


def _box(scene: RenderedPerson, dance: Choreography, frames: int) -> tuple[int, int, int, int]:
    """First and last row and column that hold the arms and the trunk in the whole dance."""
    pixels = np.concatenate([pixels_at(scene, dance, k / FPS) for k in range(frames)])
    (left, top), (right, bottom) = pixels.min(axis=0) - 60.0, pixels.max(axis=0) + 60.0
    return max(int(top), 0), min(int(bottom), HEIGHT), max(int(left), 0), min(int(right), WIDTH)


def _spread(pixels: NDArray[np.float64], visibility: NDArray[np.float64], world: NDArray[np.float64]) -> Landmarks:
    out = Landmarks(np.full((COUNT, 2), np.nan), np.zeros(COUNT), np.full((COUNT, 3), np.nan))
    assert out.world is not None
    out.pixels[TRACKED], out.visibility[TRACKED], out.world[TRACKED] = pixels, visibility, world
    return out
