"""What a pose model says about a picture: 33 BlazePose landmarks, and the eight of them that are tracked.

Left and right are the person's own, as in a picture that is not mirrored. Hips may be out of view; shoulders may not,
because without them there is no telling whose arms these are.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ik_proto import Array

COUNT = 33
"""How many landmarks BlazePose has."""


class Landmark(IntEnum):
    """Numbers of the landmarks that are used."""

    LEFT_SHOULDER = 11
    RIGHT_SHOULDER = 12
    LEFT_ELBOW = 13
    RIGHT_ELBOW = 14
    LEFT_WRIST = 15
    RIGHT_WRIST = 16
    LEFT_HIP = 23
    RIGHT_HIP = 24


TRACKED = np.array(
    [
        Landmark.LEFT_SHOULDER,
        Landmark.LEFT_ELBOW,
        Landmark.LEFT_WRIST,
        Landmark.RIGHT_SHOULDER,
        Landmark.RIGHT_ELBOW,
        Landmark.RIGHT_WRIST,
        Landmark.LEFT_HIP,
        Landmark.RIGHT_HIP,
    ]
)
"""The tracked joints in their order everywhere: the left arm from the shoulder out, the right arm, the hips."""
TRACKED.flags.writeable = False

ARMS = slice(0, 6)
"""The arms among the tracked joints; reshaped to (2, 3, ...) they are left and right, from the shoulder out."""
SHOULDERS = np.array([0, 3])
"""The shoulders among the tracked joints, left first."""
WRISTS = np.array([2, 5])
"""The wrists among the tracked joints, left first."""
HIPS = np.array([6, 7])
"""The hips among the tracked joints, left first."""

_SEEN = 0.3
"""Visibility below which a landmark is a guess. A model is sure of much that it does not see: this is no depth gate."""
_SURE = 0.5
"""Visibility that both shoulders of a credible body have."""
_SMALLEST_BODY = 0.03
"""Least distance between shoulder and hip, or between shoulders, over the picture's width."""


@dataclass(frozen=True, slots=True, eq=False)
class Landmarks:
    """One body in one picture.

    Attributes:
        pixels: Column and row, shape (33, 2) [pixel]; NaN or outside the picture where the model says so.
        visibility: Of each landmark, 0 to 1, shape (33,).
        world: The model's own guess of the body in 3D, shape (33, 3) [m], axes of the camera's optical frame, origin
            between the hips; None where the model gives none. Only differences of its depths are used.
    """

    pixels: Array
    visibility: Array
    world: Array | None = None

    def seen(self, width: int, height: int) -> NDArray[np.bool_]:
        """Which tracked joints are in the picture and more than a guess, shape (8,)."""
        p = self.pixels[TRACKED]
        # A NaN compares as false.
        inside = (p >= 0.0) & (p <= (width - 1, height - 1))
        return inside[:, 0] & inside[:, 1] & (self.visibility[TRACKED] >= _SEEN)

    def credible(self, width: int, height: int) -> bool:
        """Whether this looks like a person who faces the camera: both shoulders sure, not tiny, above the hips."""
        seen = self.seen(width, height)
        if not seen[SHOULDERS].all() or self.visibility[TRACKED[SHOULDERS]].min() < _SURE:
            return False
        left, right = self.pixels[Landmark.LEFT_SHOULDER], self.pixels[Landmark.RIGHT_SHOULDER]
        size = abs(left[0] - right[0])
        if seen[HIPS].all():
            drop = self.pixels[TRACKED[HIPS], 1].mean() - 0.5 * (left[1] + right[1])
            if drop <= 0.0:
                return False
            size = max(size, drop)
        return bool(size >= _SMALLEST_BODY * width)
