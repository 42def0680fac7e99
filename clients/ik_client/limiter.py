"""The first limiter: no joint moves by more than a fixed step per tick.

- Relative to the last command, not to the measured joints: a lagging arm does not slow the command down.
- The bound holds in plain floating point: `abs(q_next - q_last) <= max_step` is true for every joint.
- A joint whose wanted position is not finite stays where it is: without any braking, which is why this limiter is for
  comparison with the seeds, and `JointLimiter` for a robot.
"""

import math

import numpy as np

from ik_proto import Array

OPENWBT_STEP = 0.01
"""The clip OpenWBT applies to each arm joint per 5 ms control tick [rad]."""


class StepLimiter:
    """Clips each joint's step.

    Attributes:
        max_step: Largest step of a joint per tick [rad].
    """

    def __init__(self, max_step: float = OPENWBT_STEP) -> None:
        """Set the bound.

        Args:
            max_step: Largest step of a joint per tick [rad].

        Raises:
            ValueError: It is not a positive finite number.
        """
        if not (math.isfinite(max_step) and max_step > 0.0):
            raise ValueError(f"max_step must be a positive number of radians, not {max_step}")
        self.max_step = max_step
        self._rest = np.full(0, np.nan)

    @property
    def resting_point(self) -> Array:
        """Where the joints are: the last command, shape (n,) [rad]; without joints before the first."""
        return self._rest.copy()

    def limit(self, q_last: Array, q_wanted: Array, dt: float | None = None) -> Array:  # noqa: ARG002  # as limiters go
        """Move from the last command towards the wanted joints.

        Args:
            q_last: Last command, shape (n,) [rad], finite.
            q_wanted: Where to go, shape (n,) [rad].
            dt: Not looked at: the step is one a tick.

        Returns:
            The next command, shape (n,) [rad], finite. A new array.
        """
        q_finite = np.where(np.isfinite(q_wanted), q_wanted, q_last)
        q_next = np.clip(q_finite, q_last - self.max_step, q_last + self.max_step)
        # q_last + max_step may round away from q_last, by half a unit in the last place; one unit back is inside.
        beyond = np.abs(q_next - q_last) > self.max_step
        self._rest = np.where(beyond, np.nextafter(q_next, q_last), q_next)
        return self._rest.copy()
