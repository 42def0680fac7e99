"""The weight of our set-points against those of the robot's onboard controller, from 0 to 1.

It changes at one rate only, from wherever it is, so that the arms are taken and given back without a jerk: a taking
that is broken off half-way is undone in half the time.
"""


class WeightRamp:
    """The weight, moved a tick at a time.

    Attributes:
        value: The weight, 0 to 1.
    """

    def __init__(self, duration: float) -> None:
        """Start at 0.

        Args:
            duration: Time from 0 to 1, and from 1 to 0 [s].

        Raises:
            ValueError: The time is not positive.
        """
        if not duration > 0.0:
            raise ValueError(f"the weight must take a positive time, not {duration} s")
        self.value = 0.0
        self._duration = duration

    def step(self, goal: float, dt: float) -> float:
        """Move towards a goal.

        Args:
            goal: 0 or 1.
            dt: Time since the last step [s].

        Returns:
            The weight.
        """
        change, way = dt / self._duration, goal - self.value
        # The rounding of many steps must not cost a tick more, or leave a remnant of a weight.
        arrives = abs(way) <= change * (1.0 + 1e-9)
        self.value = goal if arrives else self.value + (change if way > 0.0 else -change)
        return self.value
