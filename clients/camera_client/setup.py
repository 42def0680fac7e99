"""What a run is made of: source, pose model, calibration. Each says in one line what is wrong with it."""

import dataclasses
import math
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np

from camera_client.calibration import TYPICAL, Calibration, default_folder, load
from camera_client.detector import PoseDetector
from camera_client.models import ensure_model
from camera_client.settings import Settings
from camera_client.source import DEFAULT_FIELD_OF_VIEW, FrameSource, open_source

Say = Callable[[str], None]

_SLOW = 0.5
"""How long something may take before it is explained [s]."""


def source_of(settings: Settings) -> FrameSource:
    """Open the camera, or the recording.

    Raises:
        SourceError: It cannot be opened.
    """
    return open_source(
        settings.what, field_of_view=settings.field_of_view_rad or DEFAULT_FIELD_OF_VIEW, speed=settings.replay_speed
    )


def detector_of(model: str, say: Say) -> PoseDetector:
    """Load a pose model, and make it first where it is not there yet.

    Raises:
        ModelError: It cannot be had.
    """
    return PoseDetector(model_file(model, say))


def model_file(model: str, say: Say) -> Path:
    """Find a pose model, or make it; says so where that takes a while.

    Raises:
        ModelError: It cannot be had.
    """
    slow = threading.Timer(_SLOW, say, [f"making the pose model {model}, once; it is kept for the next time ..."])
    slow.daemon = True
    slow.start()
    try:
        return ensure_model(model)
    finally:
        slow.cancel()


def calibration_of(settings: Settings) -> Calibration:
    """Whose arms these are, and how the camera stands.

    Raises:
        CalibrationError: There is no such user.
    """
    fitted = TYPICAL if settings.user is None else load(settings.user, default_folder())
    if settings.tilt is None:
        return fitted
    down = math.radians(settings.tilt)
    return dataclasses.replace(fitted, up_camera=np.array([0.0, -math.cos(down), -math.sin(down)]))


def whose(settings: Settings) -> str:
    """Whose arms these are, in words."""
    whose = f"calibration of {settings.user}" if settings.user else "not calibrated: a typical adult is assumed"
    return f"{whose}{', mirrored' if settings.mirror else ''}"
