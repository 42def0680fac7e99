"""Brings an arm from where it was last shown to where it is found again, without a jump.

What is between the two when the arm comes back, a rotation of each limb and a shift of the shoulder, is added to what
is measured from then on and worked off at a bounded speed. So a moving arm is followed at once, with an error that
goes.
"""

import numpy as np
from numpy.typing import NDArray

from camera_client.vectors import length, rotate, turn_between
from ik_proto import Array

TURN_RATE = 3.0
"""Fastest turn of a limb that is not the operator's [rad/s]."""
SHIFT_RATE = 0.5
"""Fastest shift of a shoulder that is not the operator's [m/s]."""

_TAU = 0.15
"""The last of it goes with this time constant [s]."""


class Rejoin:
    """The difference between two arms as measured and as shown."""

    def __init__(self) -> None:
        """Start without one."""
        self._turns = np.zeros((2, 2, 3))
        self._shifts = np.zeros((2, 3))

    def begin(self, arms: NDArray[np.bool_], shoulders: tuple[Array, Array], limbs: tuple[Array, Array]) -> None:
        """Arms jump from the first of each pair to the second.

        Args:
            arms: Which arms, shape (2,).
            shoulders: As last shown and as measured, shape (2, 3) [m].
            limbs: Unit directions of upper arms and forearms, as last shown and as measured, shape (2, 2, 3).
        """
        shown, measured = limbs
        self._turns = np.where(arms[:, None, None], turn_between(measured, shown), self._turns)
        self._shifts = np.where(arms[:, None], shoulders[0] - shoulders[1], self._shifts)

    def apply(self, shoulders: Array, limbs: Array, dt: float) -> tuple[Array, Array]:
        """What to show.

        Args:
            shoulders: As measured, shape (2, 3) [m].
            limbs: Unit directions as measured, shape (2, 2, 3).
            dt: Time since the last frame [s], of which a bounded part of the difference goes.

        Returns:
            The shoulders and the unit directions to show.
        """
        if not (self._turns.any() or self._shifts.any()):
            return shoulders, limbs
        self._turns = _less(self._turns, TURN_RATE, dt)
        self._shifts = _less(self._shifts, SHIFT_RATE, dt)
        return shoulders + self._shifts, rotate(limbs, self._turns)


def _less(v: Array, rate: float, dt: float) -> Array:
    size = length(v)
    left = np.maximum(size * np.exp(-dt / _TAU), size - rate * dt)
    left = np.where(left < 1e-3, 0.0, left)
    return v * (left / np.maximum(size, 1e-9))[..., None]
