"""What the tests of the camera client have to render, disturb, follow and judge people with, for the benchmark.

The tests own it, so that both measure with one measure.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "camera"))

# Found on the path that was just set.
from arm_metrics import Score, Track  # ty: ignore[import-not-found]
from human_motion import human_motions  # ty: ignore[import-not-found]
from in_time import best_angles  # ty: ignore[import-not-found]
from material import Material, render  # ty: ignore[import-not-found]
from missed import Cause  # ty: ignore[import-not-found]
from rendered_person import INTRINSICS  # ty: ignore[import-not-found]
from retargeting import ELBOW_LIKE, RATE, Possible, Replay, Retargeting  # ty: ignore[import-not-found]
from sequence import FPS, Observer, Run, fitted, follow  # ty: ignore[import-not-found]
from subjects import Take, takes  # ty: ignore[import-not-found]

__all__ = [
    "ELBOW_LIKE",
    "FPS",
    "INTRINSICS",
    "RATE",
    "Cause",
    "Material",
    "Observer",
    "Possible",
    "Replay",
    "Retargeting",
    "Run",
    "Score",
    "Take",
    "Track",
    "best_angles",
    "fitted",
    "follow",
    "human_motions",
    "render",
    "takes",
]
