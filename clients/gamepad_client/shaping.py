"""From where a stick is to how much is wanted: a radial dead zone, then a response curve.

Radial means that the way of the stick is shaped and not its axes: direction is kept, no stick is drawn to an axis. No
stick rests exactly at its middle, and few end exactly at their edge.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Shaping:
    """How a stick answers.

    Attributes:
        dead_zone: Way of the stick that counts as none, 0 to below 1.
        curve: Exponent of the response; 1 is proportional, larger is finer about the middle.
    """

    dead_zone: float = 0.12
    curve: float = 1.7

    def stick(self, x: float, y: float) -> tuple[float, float]:
        """What a stick's place means, both from -1 to 1 and within the unit circle.

        Args:
            x: One axis, -1 to 1.
            y: The other.
        """
        way = math.hypot(x, y)
        if not way > self.dead_zone:
            return 0.0, 0.0
        share = ((min(way, 1.0) - self.dead_zone) / (1.0 - self.dead_zone)) ** self.curve
        return share * x / way, share * y / way

    def pull(self, way: float) -> float:
        """What a trigger's way means, 0 to 1; a button's is 0 or 1."""
        return self.stick(way, 0.0)[0]
