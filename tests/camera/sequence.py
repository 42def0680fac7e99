"""Runs chains on a rendered, noisy sequence of a person whose joints are known."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from arm_metrics import Track
from choreography import FULL, Choreography
from model_noise import ModelNoise
from numpy.typing import NDArray
from oak_noise import OakNoise
from rendered_person import HEIGHT, INTRINSICS, WIDTH, RenderedPerson
from skinned_person import Array, rotation_about
from thesis_chain import ThesisChain

from camera_client.calibration import Calibration
from camera_client.chain import Chain
from camera_client.estimate import ArmsEstimate
from camera_client.frame import RgbdFrame
from camera_client.landmarks import COUNT, HIPS, TRACKED, Landmarks
from camera_client.t_pose import TPose

FPS = 30.0
PARTS = ("pixels", "visibility", "world")
"""What is recorded of the tracked landmarks: 1/32 pixel, 1/255, millimetres."""
_MARGIN = 45
"""Pixels around the joints that depth is needed of."""
_NO_COLOUR = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
"""The picture of a webcam, whose landmarks are at hand."""


@dataclass(frozen=True)
class Moment:
    """What is true at a time.

    Attributes:
        t: The time [s].
        depth: Exact depth, shape (height, width) [m].
        in_camera: Joints, optical frame, shape (8, 3) [m].
        in_pelvis: Joints of the arms, pelvis frame, shape (2, 3, 3) [m].
    """

    t: float
    depth: NDArray[np.float32]
    in_camera: Array
    in_pelvis: Array


@dataclass
class Observer:
    """A camera and a pose model with their own noise.

    Attributes:
        depth_noise: Of the camera.
        model_noise: Of the pose model.
        recorded: What a real pose model found in the frames of the full dance; it comes before the noise.
        last: When the last frame was taken [s].
    """

    depth_noise: OakNoise
    model_noise: ModelNoise
    recorded: list[Landmarks] | None = None
    last: float = 0.0

    @classmethod
    def seeded(cls, seed: int, sigma: float = 0.10) -> "Observer":
        rng = np.random.default_rng(seed)
        return cls(OakNoise(rng, sigma), ModelNoise(rng, INTRINSICS))

    def look(self, moment: Moment, hidden: tuple[int, ...] = ()) -> tuple[RgbdFrame, Landmarks]:
        """A frame and its landmarks; `hidden` arms are covered."""
        pixels = INTRINSICS.project(moment.in_camera)
        (left, top), (right, bottom) = pixels.min(axis=0) - _MARGIN, pixels.max(axis=0) + _MARGIN
        box = max(int(top), 0), min(int(bottom), HEIGHT), max(int(left), 0), min(int(right), WIDTH)
        frame = RgbdFrame(moment.t, self.depth_noise(moment.depth, box), INTRINSICS)
        if self.recorded is None:
            landmarks = self.model_noise.look(moment.in_camera, moment.t - self.last, hidden)
        else:
            landmarks = self.recorded[round(moment.t * FPS)]
        self.last = moment.t
        return frame, landmarks


def moments(
    scene: RenderedPerson, dance: Choreography, begin: float = 0.0, end: float | None = None
) -> Iterator[Moment]:
    """Render a choreography, or a part of it."""
    for k in range(round(begin * FPS), round((dance.duration if end is None else end) * FPS)):
        yield moment(scene, dance, k / FPS)


def moment(scene: RenderedPerson, dance: Choreography, t: float) -> Moment:
    """Render one moment of it."""
    return moment_with_colour(scene, dance, t)[0]


def moment_with_colour(scene: RenderedPerson, dance: Choreography, t: float) -> tuple[Moment, NDArray[np.uint8]]:
    """The same, and its picture."""
    R, p, yaw = _pose(scene, dance, t)
    colour, depth = scene.render(R, p)
    joints = scene.person.joints(p)
    upright = rotation_about(np.array([0.0, 0.0, 1.0]), yaw)
    in_pelvis = (joints[:6] - joints[HIPS].mean(axis=0)) @ upright
    return Moment(t, depth, scene.in_camera(joints), in_pelvis.reshape(2, 3, 3)), colour


def pixels_at(scene: RenderedPerson, dance: Choreography, t: float) -> Array:
    """Pixels of the true joints, shape (8, 2)."""
    _, p, _ = _pose(scene, dance, t)
    return INTRINSICS.project(scene.in_camera(scene.person.joints(p)))


def _pose(scene: RenderedPerson, dance: Choreography, t: float) -> tuple[Array, Array, float]:
    u, f, yaw, sway = dance.at(t)
    R, p = scene.person.pose(u, f, yaw, np.array([0.0, 0.0, scene.person.height]) + sway)
    return R, p, yaw


def calibrated(scene: RenderedPerson, observer: Observer, frames: int = 45) -> Calibration:
    """Calibrate on a T pose, as an operator would."""
    if observer.recorded is not None:
        begin, end = (round(t * FPS) for t in FULL.t_pose)
        return fitted((moment(scene, FULL, k / FPS) for k in range(begin, end)), observer)
    exact = moment(scene, Choreography(((0.0, "T", "T"), (1.0, "T", "T"))), 0.0)
    return fitted((replace(exact, t=k / FPS) for k in range(frames)), observer)


def fitted(stills: Iterable[Moment], observer: Observer) -> Calibration:
    """Calibrate on these moments."""
    pose = TPose()
    for still in stills:
        pose.add(*observer.look(still))
    observer.last = 0.0
    return pose.finish()


def recorded(name: str) -> list[Landmarks]:
    """What MediaPipe 0.10.30, model *full*, found in every frame of the full dance, with the person's colours.

    Args:
        name: "as_measured" or "short_and_broad", the person's shape.
    """
    data = np.load(Path(__file__).parent / "vectors" / "mediapipe_full.npz")
    out = []
    for pixels, visibility, world in zip(*(data[f"{name}_{part}"] for part in PARTS), strict=True):
        look = Landmarks(np.full((COUNT, 2), np.nan), np.zeros(COUNT), np.full((COUNT, 3), np.nan))
        assert look.world is not None
        look.pixels[TRACKED], look.visibility[TRACKED] = pixels / 32.0, visibility / 255.0
        look.world[TRACKED] = world / 1000.0
        out.append(look)
    return out


@dataclass
class Run:
    """Chains on the same frames.

    Attributes:
        ours: Of `camera_client`.
        webcam: The same without depth, for an operator who is calibrated.
        thesis: The published chain.
        seconds: How long `Chain.update` took with depth [s].
        estimates: What it gave.
    """

    ours: Track = field(default_factory=Track)
    webcam: Track = field(default_factory=Track)
    thesis: Track = field(default_factory=Track)
    seconds: list[float] = field(default_factory=list)
    estimates: list[ArmsEstimate] = field(default_factory=list)


def run(
    scene: RenderedPerson,
    dance: Choreography,
    observers: list[Observer],
    hidden: Callable[[float], tuple[int, ...]] = lambda t: (),
) -> list[Run]:
    """Show a choreography to observers, who share the rendering but not the noise."""
    calibrations = [calibrated(scene, observer) for observer in observers]
    return follow(moments(scene, dance), observers, calibrations, hidden)


def follow(
    shown: Iterable[Moment],
    observers: list[Observer],
    calibrations: list[Calibration],
    hidden: Callable[[float], tuple[int, ...]] = lambda t: (),
) -> list[Run]:
    """Show moments to calibrated observers."""
    chains = [(Chain(calibration), Chain(calibration), ThesisChain()) for calibration in calibrations]
    runs = [Run() for _ in observers]
    for now in shown:
        for observer, (chain, webcam, thesis), out in zip(observers, chains, runs, strict=True):
            frame, landmarks = observer.look(now, hidden(now.t))
            began = time.perf_counter()
            estimate = chain.update(frame, landmarks)
            out.seconds.append(time.perf_counter() - began)
            assert estimate is not None
            out.estimates.append(estimate)
            out.ours.add(now.t, now.in_pelvis, estimate.joints, estimate.R_pelvis_wrist)
            out.thesis.add(now.t, now.in_pelvis, *thesis.update(frame, landmarks))
            blind = webcam.update(replace(frame, depth=None, colour=_NO_COLOUR), landmarks)
            if blind is not None:
                out.webcam.add(now.t, now.in_pelvis, blind.joints, blind.R_pelvis_wrist)
    return runs
