"""Finds one person in pictures: MediaPipe's pose landmarker, frame after frame.

- A picture is red, green, blue and not mirrored, or left and right are swapped.
- It follows the person it found; whose arms they are is for `operator_lock` to say.
- Nothing leaves this machine: this MediaPipe opens no connection.
"""

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camera_client.landmarks import COUNT, Landmarks
from camera_client.models import ModelError
from camera_client.pose_library import mediapipe

_STANDARD_ERROR = 2
_REHEARSAL = np.zeros((64, 64, 3), np.uint8)


class PoseDetector:
    """A pose model at work. Use it in one thread at a time, and close it."""

    def __init__(self, model: Path) -> None:
        """Load a model.

        Args:
            model: A `.task` file, see `models.ensure_model`.

        Raises:
            ModelError: MediaPipe takes it for no pose landmarker.
            camera_client.pose_library.NoMediaPipe: MediaPipe is not here.
        """
        self._mp = mediapipe()
        with _silence():
            # MediaPipe warns of its own affairs when a body is first looked at. So one is, before it matters: with no
            # confidence asked for, a black picture holds one.
            self._open(model, confidence=0.0).close()
            self._landmarker = self._open(model, confidence=0.5)
        self._stamp = 1  # That of the rehearsal.

    def detect(self, colour: NDArray[np.uint8], t_capture: float) -> Landmarks | None:
        """Look for a person.

        Args:
            colour: Red, green, blue, shape (height, width, 3).
            t_capture: When it was taken, by a clock that never jumps [s].

        Returns:
            Their landmarks; None for nobody.
        """
        # MediaPipe takes whole milliseconds, and every stamp greater than the one before.
        self._stamp = max(self._stamp + 1, round(t_capture * 1e3))
        return self._look(self._landmarker, colour, self._stamp)

    def close(self) -> None:
        """Free the model. Once is enough, twice does no harm."""
        if self._landmarker is not None:
            self._landmarker.close()
            self._landmarker = None

    def _open(self, model: Path, confidence: float) -> Any:
        tasks = self._mp.tasks
        options = tasks.vision.PoseLandmarkerOptions(
            base_options=tasks.BaseOptions(model_asset_path=str(model)),
            running_mode=tasks.vision.RunningMode.VIDEO,
            num_poses=1,
            min_pose_detection_confidence=confidence,
        )
        try:
            landmarker = tasks.vision.PoseLandmarker.create_from_options(options)
            self._look(landmarker, _REHEARSAL, stamp=0)
        except (OSError, RuntimeError, ValueError) as error:
            raise ModelError(f"{model} is no pose landmarker ({str(error).splitlines()[0]})") from None
        return landmarker

    def _look(self, landmarker: Any, colour: NDArray[np.uint8], stamp: int) -> Landmarks | None:
        height, width = colour.shape[:2]
        image = self._mp.Image(self._mp.ImageFormat.SRGB, np.ascontiguousarray(colour))
        found = landmarker.detect_for_video(image, stamp)
        if not found.pose_landmarks:
            return None
        (body, *_), (world, *_) = found.pose_landmarks, found.pose_world_landmarks
        # 0 and 1 are the edges of the picture; pixel 0 is the centre of the first pixel.
        pixels = np.array([(point.x * width - 0.5, point.y * height - 0.5) for point in body])
        assert pixels.shape == (COUNT, 2)
        return Landmarks(
            pixels=pixels,
            visibility=np.array([point.visibility for point in body]),
            world=np.array([(point.x, point.y, point.z) for point in world]),
        )


@contextmanager
def _silence() -> Generator[None]:
    """Send what C++ code says on standard error nowhere; it knows no other way. For all threads, so be quick."""
    kept = os.dup(_STANDARD_ERROR)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, _STANDARD_ERROR)
        yield
    finally:
        os.dup2(kept, _STANDARD_ERROR)
        os.close(kept)
        os.close(nowhere)
