"""Latest wins, with credits: which image goes to a page next, and when one is worth making. One slot per page. Pure.

- A page has `CREDITS` images under way at most; a credit comes back when the page says that it has shown one.
- While it has none, newer images replace the one that waits. So a slow page sees fewer images, never older ones, and
  what waits is one image however long it stalls.
- An acknowledgement of an image that is not under way gives no credit.
- An image is worth making when nothing is under way, or when what was sent last should have been shown by now. Made at
  once it would queue behind that one and grow old, and drawing it would take time from the page where both share a
  machine.
"""

import math

from ik_proto.stereo_packet import StereoFrame

CREDITS = 2

_SMOOTHING = 0.2


class VideoSlot:
    """The images on their way to one page.

    Attributes:
        sent: Images taken from the slot.
        skipped: Images replaced before they were taken.
        shown: Images acknowledged.
    """

    def __init__(self, credit: int = CREDITS) -> None:
        """Start empty.

        Args:
            credit: How many images may be under way.
        """
        self.sent = 0
        self.skipped = 0
        self.shown = 0
        self._credit = credit
        self._waiting: StereoFrame | None = None
        self._under_way: dict[int, tuple[float, float]] = {}
        self._sent = -math.inf
        self._way: float | None = None

    def worth_making(self, now: float) -> float:
        """How long until a new image is worth making [s]: 0 for now, infinity before the next acknowledgement.

        Args:
            now: Monotonic time [s].
        """
        if self._waiting is not None or len(self._under_way) >= self._credit:
            return math.inf
        if not self._under_way:
            return 0.0
        # How long an image takes is not known before the first has been shown.
        return math.inf if self._way is None else max(self._sent + self._way - now, 0.0)

    def offer(self, frame: StereoFrame) -> None:
        """Put an image into the slot, in the place of what waits there."""
        self.skipped += self._waiting is not None
        self._waiting = frame

    def take(self, now: float) -> StereoFrame | None:
        """The image to send now; None where there is none, or no credit for it.

        Args:
            now: Monotonic time [s].
        """
        frame = self._waiting
        if frame is None or len(self._under_way) >= self._credit:
            return None
        self._waiting = None
        self._under_way[frame.seq] = (frame.taken_ms, now)
        self._sent = now
        self.sent += 1
        return frame

    def acknowledge(self, seq: int, now: float) -> float | None:
        """A page has shown an image.

        Args:
            seq: Its number.
            now: Monotonic time [s].

        Returns:
            When it was taken [ms]; None where it was not under way.
        """
        under_way = self._under_way.pop(seq, None)
        if under_way is None:
            return None
        taken_ms, sent = under_way
        self.shown += 1
        way = now - sent
        self._way = way if self._way is None else self._way + _SMOOTHING * (way - self._way)
        return taken_ms
