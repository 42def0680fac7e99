"""A headset that repeats a position to the bit has lost the hand, whatever it says.

The gate of the teleop loop looks for the same, but in the frame its hands are given in; where that follows the head,
a frozen hand moves in it. So it is looked for here, in the room.
"""

import math

from ik_proto import Array


class FreezeWatch:
    """Watches the position of one hand."""

    def __init__(self, limit: float = 0.5) -> None:
        """Start without memory.

        Args:
            limit: How long a position may stay the same to the bit [s].
        """
        self._limit = limit
        self._position = b""
        self._since = -math.inf

    def frozen(self, position: Array, now: float) -> bool:
        """Say whether a hand is frozen.

        Args:
            position: Where it is in the room, shape (3,) [m].
            now: Time [s], monotonic.
        """
        here = position.tobytes()
        if here != self._position:
            self._position, self._since = here, now
        return now - self._since > self._limit
