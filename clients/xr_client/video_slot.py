"""Latest wins, with credits: which image goes to a page next. One slot per page. Pure: no socket, no clock.

- A page has `CREDITS` images under way at most; a credit comes back when the page says that it has shown one.
- While it has none, newer images replace the one that waits. So a slow page sees fewer images, never older ones, and
  what waits is one image however long it stalls.
- An acknowledgement of an image that is not under way gives no credit.
"""

from ik_proto.stereo_packet import StereoFrame

CREDITS = 2


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
        self._under_way: dict[int, float] = {}

    def offer(self, frame: StereoFrame) -> None:
        """Put an image into the slot, in the place of what waits there."""
        self.skipped += self._waiting is not None
        self._waiting = frame

    def take(self) -> StereoFrame | None:
        """The image to send now; None where there is none, or no credit for it."""
        frame = self._waiting
        if frame is None or len(self._under_way) >= self._credit:
            return None
        self._waiting = None
        self._under_way[frame.seq] = frame.taken_ms
        self.sent += 1
        return frame

    def acknowledge(self, seq: int) -> float | None:
        """A page has shown an image.

        Args:
            seq: Its number.

        Returns:
            When it was taken [ms]; None where it was not under way.
        """
        taken_ms = self._under_way.pop(seq, None)
        self.shown += taken_ms is not None
        return taken_ms
