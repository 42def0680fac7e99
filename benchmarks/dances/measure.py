"""Measures how well arms are followed: rendered people, real landmarks, and what remains where a part is exact."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.dances.means import (
    INTRINSICS,
    Material,
    Observer,
    Run,
    Score,
    Take,
    fitted,
    follow,
    render,
)
from camera_client.calibration import Calibration
from camera_client.detector import PoseDetector
from camera_client.landmarks import ARMS, SHOULDERS, TRACKED, Landmarks
from camera_client.models import DEFAULT, ensure_model
from camera_client.surface import SHOULDER_DROP

CHAINS = ("ours", "webcam", "thesis")
_FAR = 9.0
"""Depths end here [m]."""


@dataclass(frozen=True)
class Danced:
    """How a take went, over the seeds.

    Attributes:
        body: Who danced.
        dance: What.
        fresh: Whether the chain was made without having seen it.
        scores: Of each chain, one for each seed.
        milliseconds: Median time that the chain took for a frame.
        traces: Time, where the left wrist truly is and is shown, forward of the pelvis, of the first seed, for a chart.
    """

    body: str
    dance: str
    fresh: bool
    scores: dict[str, list[Score]]
    milliseconds: float
    traces: dict[str, list[float]]

    def worst(self, chain: str) -> dict[str, float]:
        """The worst of the seeds in each number."""
        rows = [asdict(score) for score in self.scores[chain]]
        return {name: float(np.max([row[name] for row in rows])) for name in rows[0]}

    def document(self) -> dict[str, Any]:
        """JSON-ready."""
        scores = {chain: [asdict(score) for score in ones] for chain, ones in self.scores.items()}
        worst = {chain: self.worst(chain) for chain in CHAINS}
        head = {"body": self.body, "dance": self.dance, "fresh": self.fresh, "milliseconds": self.milliseconds}
        return {**head, "scores": scores, "worst": worst, "traces": self.traces}


def rendered(take: Take, mesh: Path, folder: Path, told: Callable[[], object]) -> Material:
    """The material of a take, rendered and looked at where it is not in the folder yet."""
    file = folder / f"{take.name}.npz"
    if not file.is_file():
        detector = PoseDetector(ensure_model(DEFAULT))
        try:
            render(take, mesh, detector.detect, file, told)
        finally:
            detector.close()
    return Material(file, take.dance)


def danced(take: Take, material: Material, seeds: list[int]) -> Danced:
    """Follow a take with all chains."""
    runs = _runs(material, [Observer.seeded(seed) for seed in seeds])
    scores = {chain: [getattr(run, chain).score(take.dance) for run in runs] for chain in CHAINS}
    first = runs[0]
    traces = {"t": list(first.ours.times), "truth": [float(joints[0, 2, 0]) for joints in first.ours.truth]}
    traces |= {chain: [float(joints[0, 2, 0]) for joints in getattr(first, chain).joints] for chain in CHAINS}
    milliseconds = 1e3 * float(np.median(np.concatenate([run.seconds for run in runs])))
    return Danced(take.subject.name, take.title, take.fresh, scores, milliseconds, traces)


def budget(take: Take, material: Material, seed: int) -> dict[str, Score]:
    """What remains of the error where depth, landmarks or both are exact."""
    out = {}
    for name, depth, pixels in (
        ("as measured", False, False),
        ("exact depth", True, False),
        ("exact landmarks", False, True),
        ("exact depth and landmarks", True, True),
    ):
        observer = Observer.seeded(seed)
        if depth:
            observer.depth_noise = _millimetres
        (run,) = _runs(material, [observer], exact_landmarks=pixels)
        out[name] = run.ours.score(take.dance)
    return out


def _millimetres(exact: Any, _box: Any) -> Any:
    """Depth without noise, as a picture has it."""
    return np.rint(1000.0 * np.minimum(exact, _FAR)).astype(np.uint16)


def _runs(material: Material, observers: list[Observer], exact_landmarks: bool = False) -> list[Run]:
    landmarks = [_exact(now) for now in material.moments()] if exact_landmarks else material.landmarks
    for observer in observers:
        observer.recorded = landmarks
    begin, end = material.dance.t_pose
    stills = [now for now in material.moments() if begin <= now.t < end]
    calibrations: list[Calibration] = [fitted(iter(stills), observer) for observer in observers]
    return follow(material.moments(), observers, calibrations)


def _exact(now: Any) -> Landmarks:
    """Landmarks where the joints are; those of shoulders are above them, as the chain expects."""
    joints = now.in_camera.copy()
    joints[SHOULDERS, 1] -= SHOULDER_DROP
    out = Landmarks(np.full((33, 2), np.nan), np.zeros(33), np.full((33, 3), np.nan))
    assert out.world is not None
    out.pixels[TRACKED], out.visibility[TRACKED] = INTRINSICS.project(joints), 1.0
    out.world[TRACKED] = now.in_camera - now.in_camera[ARMS.stop :].mean(axis=0)
    return out
