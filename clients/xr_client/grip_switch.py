"""The hold-to-run switch made of a squeeze or a pinch.

- Closed and open have thresholds of their own, so that a value in between does not chatter.
- A pinch seen to begin must last a moment before it counts, because fingers touch by accident. Letting go counts
  at once, and so does a pinch that was there already when the hand came in sight: it must not look like a new one.
- A controller's squeeze is known while its pose is lost; a pinch is not.
"""

import math
from dataclasses import dataclass

from xr_client.packets import HandPacket, Kind


@dataclass(frozen=True, slots=True)
class GripThresholds:
    """When a switch is closed and open.

    Attributes:
        squeeze_close: Squeeze at which it closes, 0 to 1.
        squeeze_open: Squeeze at which it opens.
        pinch_close: Distance of thumb and index finger at which it closes [m].
        pinch_open: Distance at which it opens [m].
        dwell: How long a pinch must last [s].
    """

    squeeze_close: float = 0.7
    squeeze_open: float = 0.4
    pinch_close: float = 0.015
    pinch_open: float = 0.03
    dwell: float = 0.15


class GripSwitch:
    """One hand's switch, one update per packet."""

    def __init__(self, thresholds: GripThresholds | None = None) -> None:
        """Start without knowing.

        Args:
            thresholds: When it is closed and open.
        """
        self._thresholds = thresholds or GripThresholds()
        self._kind = Kind.NONE
        self._closed: bool | None = None
        self._since = 0.0

    def update(self, hand: HandPacket, now: float) -> bool | None:
        """Take a packet's hand.

        Args:
            hand: What the packet says.
            now: When it arrived [s], monotonic.

        Returns:
            Whether the switch is held; None where it cannot be told.
        """
        limits = self._thresholds
        if hand.kind is not self._kind:
            self._kind, self._closed = hand.kind, None
        if hand.kind is Kind.CONTROLLER:
            self._closed = hand.squeeze >= (limits.squeeze_open if self._closed else limits.squeeze_close)
            return self._closed
        if hand.kind is Kind.NONE or hand.pinch is None:
            self._closed = None
            return None
        before, self._closed = self._closed, hand.pinch <= (limits.pinch_open if self._closed else limits.pinch_close)
        if self._closed and not before:
            self._since = now if before is False else -math.inf
        return self._closed and now - self._since >= limits.dwell
