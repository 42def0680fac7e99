"""A constant-velocity Kalman filter for many joints at once, with true time steps and an innovation gate.

The three axes of a joint are independent, because the noise is taken to be along the camera's axes: so a covariance is
three numbers an axis, and everything is elementwise.

- Time steps are those between captures. A lost frame is a longer step.
- A measurement far outside what is expected is refused; after a few in a row the joint has really gone there, and the
  filter starts again from it.
- A joint accelerates as much as its innovations say: as long as they keep their sign it is on its way, and where they
  do not they are noise. So a hand that is held still is held still, and one that moves is followed at once.
- A joint that is not measured slows down instead of flying on.
"""

import numpy as np
from numpy.typing import NDArray

from ik_proto import Array

Mask = NDArray[np.bool_]

GATE = 16.0
"""Squared Mahalanobis distance beyond which a measurement is refused; 0.1 % of the good ones, with 3 axes."""
PATIENCE = 6
"""Refusals in a row after which the measurement is believed."""

CALM = 0.02
"""Factor on the variance of the acceleration of a joint that is still."""
_DRIFT_TAU = 0.10
"""Time over which it is judged which of it is the case [s]."""
_DRIFT = 0.5
"""Mean innovation that counts as being on the way, in standard deviations of a measurement."""
_COAST = 0.1
"""Time in which the speed of an unmeasured joint falls to 1/e [s]."""
_START_SPEED = 1.0
"""Standard deviation of the speed of a joint that was just found [m/s]."""


class JointFilter:
    """Positions and velocities of joints.

    Attributes:
        position: Shape (n, 3) [m]; without meaning where not `known`.
        velocity: Shape (n, 3) [m/s].
        known: Which joints have been measured, shape (n,).
    """

    def __init__(self, count: int, acceleration: float | Array = 12.0, calm: float = CALM) -> None:
        """Start knowing nothing.

        Args:
            count: How many joints.
            acceleration: Standard deviation of a joint's acceleration, of all or of each, shape (n,) [m/s^2].
            calm: Factor on its variance while a joint is still; 1 makes it a textbook's filter.
        """
        self.position = np.zeros((count, 3))
        self.velocity = np.zeros((count, 3))
        self.known: Mask = np.zeros(count, dtype=bool)
        self._variance = np.ones((count, 3))
        self._cross = np.zeros((count, 3))
        self._speed_variance = np.ones((count, 3))
        self._acceleration_variance = np.broadcast_to(acceleration, (count,))[:, None] ** 2
        self._drift = np.zeros((count, 3))
        self._agility = np.ones((count, 3))
        self._calm = calm
        self._dt = 0.0
        self._refused = np.zeros(count, dtype=int)
        self._missed: Mask = np.zeros(count, dtype=bool)

    @property
    def sigma(self) -> Array:
        """Standard deviations of the positions, shape (n, 3) [m]; infinite where not known."""
        return np.where(self.known[:, None], np.sqrt(self._variance), np.inf)

    def predict(self, dt: float) -> None:
        """Move on in time.

        Args:
            dt: Time since the last frame [s], not negative.
        """
        if self._missed.any():
            self.velocity[self._missed] *= np.exp(-dt / _COAST)
        self._dt += dt
        q = self._acceleration_variance * dt * dt * self._agility
        self.position += dt * self.velocity
        # P <- F P F' + Q with F = [[1, dt], [0, 1]] and Q that of an acceleration that is constant in a step.
        self._variance += dt * (2.0 * self._cross + dt * self._speed_variance) + 0.25 * q * dt * dt
        self._cross += dt * self._speed_variance + 0.5 * q * dt
        self._speed_variance += q

    def update(self, measured: Array, sigma: Array, seen: Mask) -> Mask:
        """Take measurements.

        Args:
            measured: Positions, shape (n, 3) [m]; anything where not seen.
            sigma: Their standard deviations along the axes, shape (n, 3) [m].
            seen: Which joints are measured, shape (n,).

        Returns:
            Which joints start anew from their measurement, shape (n,).
        """
        r = np.where(seen[:, None], sigma * sigma, 1.0)
        y = np.where(seen[:, None], measured - self.position, 0.0)
        total = self._variance + r
        far = (y * y / total).sum(axis=1) > GATE
        self._refused = np.where(seen & self.known & far, self._refused + 1, np.where(seen, 0, self._refused))
        anew = seen & (~self.known | (self._refused > PATIENCE))
        good = seen & self.known & ~far
        self._missed = self.known & ~(good | anew)
        self._drift += (seen & self.known)[:, None] * (1.0 - np.exp(-self._dt / _DRIFT_TAU)) * (y - self._drift)
        self._dt = 0.0
        self._agility = ((self._drift**2 / (_DRIFT**2 * r)) ** 2).clip(self._calm, 1.0)
        gain = np.where(good[:, None], self._variance / total, 0.0)
        speed_gain = np.where(good[:, None], self._cross / total, 0.0)
        self.position += gain * y
        self.velocity += speed_gain * y
        self._speed_variance -= speed_gain * self._cross
        self._cross *= 1.0 - gain
        self._variance *= 1.0 - gain
        if anew.any():
            self.position[anew], self.velocity[anew] = measured[anew], 0.0
            self._variance[anew], self._cross[anew] = r[anew], 0.0
            self._speed_variance[anew] = _START_SPEED**2
            self._drift[anew], self._agility[anew] = 0.0, 1.0
            self._refused[anew] = 0
            self.known |= anew
        return anew

    def forget(self, joints: Mask) -> None:
        """Know nothing of these joints any more."""
        self.known &= ~joints
        self._missed &= ~joints
        self._refused[joints] = 0
