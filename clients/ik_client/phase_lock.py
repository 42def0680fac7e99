"""Keeps a fast loop in step with the robot, which takes the newest command once in each of its own, longer periods.

Two schedules that know nothing of each other drift, and now and then a command comes just before the robot looks, the
next one just after: the robot sees three, then five steps of an even motion, brakes, catches up, and each joint does so
in its own time. So the loop's schedule is moved, little by little, until a tick begins when a state has just arrived.
That leaves half a tick or so to the moment at which the robot looks, whenever in its period that is.
"""

from ik_client.pacer import Pacer

BEFORE = 0.5e-3
"""How long before a tick a state shall arrive [s]: what arrivals scatter."""

SHARE = 0.05
"""How much of what is missing is made up for with each state."""

_EVEN = 0.01
"""How far the robot's period may be from a multiple of ours, in ours."""


class PhaseLock:
    """Moves a pacer's schedule."""

    def __init__(self, pacer: Pacer, period: float, robot_period: float) -> None:
        """Take the schedules.

        Args:
            pacer: Of the loop.
            period: Of the loop [s].
            robot_period: Time from one state of the robot to the next [s]. Where it is no multiple of the loop's there
                is nothing to lock to, and nothing is moved.
        """
        self._pacer = pacer
        self._period = period
        steps = robot_period / period
        self._even = steps >= 1.0 - _EVEN and abs(steps - round(steps)) <= _EVEN
        self._arrived = 0.0

    def follow(self, arrived: float) -> None:
        """Take the newest state, once a tick.

        Args:
            arrived: When it arrived [s], by the pacer's clock.
        """
        if not self._even or arrived == self._arrived or self._pacer.due is None:
            return
        self._arrived = arrived
        late = arrived + BEFORE - self._pacer.due
        late -= self._period * round(late / self._period)
        self._pacer.shift(SHARE * late)
