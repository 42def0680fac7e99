"""The feed-forward torque of the set-point: gravity, as far as the commands tell.

- It goes as far towards the command's torque as the set-point goes towards the command's joints.
- It changes at a bounded rate. The gravity torque of arms that move within their limits changes slower than that, so it
  passes unchanged; a torque that is switched on or off is blended.
- Without a command to follow it is kept. The robot's end knows no dynamics, so while the arms brake after a command
  that did not come, the torque is that of a posture a stopping distance away. That is much nearer to the truth than
  none at all, with which the arms would drop.
"""

import numpy as np

from ik_proto import Array

TORQUE_RATE = 100.0
"""Largest change of a joint's torque [N m/s]. An outstretched arm of the G1 moved at 3 rad/s needs less than half."""


class HeldTorque:
    """The torque, moved a tick at a time."""

    def __init__(self, n: int, rate: float = TORQUE_RATE) -> None:
        """Start with none.

        Args:
            n: Number of joints.
            rate: Largest change of a joint's torque [N m/s].
        """
        self._tau = np.zeros(n)
        self._rate = rate

    @property
    def value(self) -> Array:
        """The torque, shape (n,) [N m]."""
        return self._tau.copy()

    def reset(self) -> None:
        """Go back to none."""
        self._tau = np.zeros(len(self._tau))

    def step(self, tau_wanted: Array, progress: float, dt: float) -> Array:
        """Move towards the torque of a command.

        Args:
            tau_wanted: That torque, shape (n,) [N m].
            progress: How far the joints went on their way to the command, 0 to 1.
            dt: Time since the last step [s].

        Returns:
            The torque, shape (n,) [N m].
        """
        change = progress * (tau_wanted - self._tau)
        self._tau = self._tau + np.clip(change, -self._rate * dt, self._rate * dt)
        return self.value
