"""Notices arms that leap: a limb that was taken to point at the camera is taken to point away from it, say.

What counts is how far the wrist is from where the limbs' last turn would have taken it. No hand accelerates like that,
so it is the measurement that has changed its mind.
"""

import numpy as np
from numpy.typing import NDArray

from camera_client.vectors import length, rotate, turn_between
from ik_proto import Array

ACCELERATION = 60.0
"""What no hand has [m/s^2]."""


class LeapWatch:
    """Compares the limbs of both arms from frame to frame."""

    def __init__(self) -> None:
        """Start without a frame."""
        self._limbs: Array | None = None
        self._turn = np.zeros((2, 2, 3))
        self._dt = 0.0

    def update(self, limbs: Array, lengths: Array, dt: float) -> NDArray[np.bool_]:
        """Take the limbs of a frame.

        Args:
            limbs: Unit directions of upper arm and forearm as measured, left and right, shape (2, 2, 3).
            lengths: Of these limbs, shape (2, 2) [m].
            dt: Time since the last frame [s].

        Returns:
            Which arms have leapt, shape (2,).
        """
        before, self._limbs = self._limbs, limbs
        if before is None or dt <= 0.0:
            return np.zeros(2, dtype=bool)
        expected = rotate(before, self._turn * (dt / self._dt) if self._dt > 0.0 else self._turn)
        self._turn, self._dt = turn_between(before, limbs), dt
        off = (lengths[..., None] * (limbs - expected)).sum(axis=1)
        return np.asarray(length(off) > ACCELERATION * dt * dt)
