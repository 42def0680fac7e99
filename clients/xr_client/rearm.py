"""A hand that comes from somewhere else must be gripped anew.

Another epoch (a recentred room), another connection, another kind of tracking (a controller laid down, a hand raised)
or a session that was hidden: whatever was gripped before, was gripped elsewhere. The hand is lost for a tick, and its
grip counts as open until it was seen open.
"""

from collections.abc import Hashable
from dataclasses import replace

from ik_client.hand import HandSample


class Rearm:
    """Watches one hand, one update per tick of the loop."""

    def __init__(self) -> None:
        """Start locked: a grip held from the beginning counts as open."""
        self._origin: Hashable = None
        self._locked = True

    def admit(self, sample: HandSample | None, origin: Hashable) -> HandSample | None:
        """Take the sample of this tick.

        Args:
            sample: What the headset says of the hand; None where it says nothing.
            origin: What it comes from, equal as long as samples may be compared.

        Returns:
            The sample, with its grip open and its hand lost where it must be gripped anew.
        """
        moved, self._origin = origin != self._origin, origin
        self._locked = moved or self._locked
        if sample is None:
            return None
        if self._locked and sample.grip is False:
            self._locked = False
        grip = False if self._locked else sample.grip
        return replace(sample, grip=grip, tracked=sample.tracked and not moved)
