"""Depths of the joints from a picture alone: the pose model's guess of the body, put where it fits the pixels.

The model gives a body in metres, in the camera's axes, but neither where it is nor how large the person is. Scaled to
the operator's arms and trunk it is shifted until it projects to the landmarks. With s P_j for the scaled body and r_j
for the viewing rays, the shift t solves

    (s P_j + t)_xy = r_j (s P_j + t)_z    for all joints, in the least squares,

which is linear in t. Distances are then as good as the model's guess of the posture: a decimetre, and more for an arm
that points at the camera.
"""

import numpy as np
from numpy.typing import NDArray

from camera_client.calibration import Calibration
from camera_client.frame import Intrinsics
from camera_client.landmarks import ARMS, HIPS, SHOULDERS, TRACKED, Landmarks
from camera_client.vectors import length
from ik_proto import Array

MODEL_SIGMA = 0.08
"""Standard deviation of a depth of the model [m]."""

_NEAREST = 0.3
"""Nobody stands nearer [m]."""


def model_depths(
    landmarks: Landmarks, seen: NDArray[np.bool_], intrinsics: Intrinsics, calibration: Calibration
) -> Array | None:
    """Guess the depths of the joints.

    Args:
        landmarks: What the pose model found, with its guess of the body.
        seen: Which tracked joints are in the picture, shape (8,); both shoulders are.
        intrinsics: Of the picture.
        calibration: The operator.

    Returns:
        Depths of the joints' centres, shape (8,) [m], NaN where not seen; None where the model has no guess.
    """
    if landmarks.world is None:
        return None
    body = landmarks.world[TRACKED]
    if not np.isfinite(body).all():
        return None
    limbs = length(np.diff(body[ARMS].reshape(2, 3, 3), axis=1)).sum()
    trunk = length(body[HIPS].mean(axis=0) - body[SHOULDERS].mean(axis=0))
    scale = (calibration.lengths.sum() + length(calibration.hips_below)) / max(float(limbs + trunk), 1e-3)
    points = scale * body[seen]
    rays = intrinsics.rays(landmarks.pixels[TRACKED][seen])[:, :2]
    A = np.zeros((len(points), 2, 3))
    A[:, 0, 0] = A[:, 1, 1] = 1.0
    A[:, :, 2] = -rays
    b = rays * points[:, 2:] - points[:, :2]
    shift = np.linalg.lstsq(A.reshape(-1, 3), b.ravel(), rcond=None)[0]
    if not shift[2] > _NEAREST:
        return None
    depths = np.full(len(TRACKED), np.nan)
    depths[seen] = points[:, 2] + shift[2]
    return depths
