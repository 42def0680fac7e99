"""Going home: each joint's velocity is its gain times what is left of its way, none faster than a bound.

The P controller of the published rate control, with all joints slowed by the same factor instead of each clipped alone:
so the arms go straight through the joint space, and all joints arrive together. Acceleration is bounded by the limiter
behind it, and whether the way is clear of the body is judged behind that.
"""

import numpy as np

from ik_proto import Array

ARRIVED = 0.01
"""Distance of a joint from home that counts as none [rad]."""


class Homing:
    """The way to one posture."""

    def __init__(self, target: Array, gain: float = 2.0, speed: float = 0.5) -> None:
        """Say where home is.

        Args:
            target: Joints of that posture, shape (n,) [rad].
            gain: Share of the rest of the way that is made in a second [1/s].
            speed: Largest speed of a joint [rad/s].

        Raises:
            ValueError: The posture is no vector of finite numbers, or gain or speed is not positive and finite.
        """
        self.target = np.array(target, dtype=np.float64)
        if self.target.ndim != 1 or not np.isfinite(self.target).all():
            raise ValueError("home must be a vector of finite numbers")
        if not (0.0 < gain < np.inf and 0.0 < speed < np.inf):
            raise ValueError(f"gain and speed of going home must be positive numbers, not {gain} and {speed}")
        self._gain = gain
        self._speed = speed

    def velocity(self, q: Array) -> Array:
        """How to move from here.

        Args:
            q: Joints as commanded, shape (n,) [rad].

        Returns:
            Joint velocities, shape (n,) [rad/s].
        """
        wanted = self._gain * (self.target - q)
        return wanted * min(1.0, self._speed / max(float(np.abs(wanted).max()), 1e-12))

    def arrived(self, q: Array) -> bool:
        """Whether every joint is within `ARRIVED` of home.

        Args:
            q: Joints, shape (n,) [rad].
        """
        return bool(np.all(np.abs(q - self.target) <= ARRIVED))
