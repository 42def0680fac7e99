"""How far a page's clock is ahead of ours, from pings and pongs. For display only: no safety rule compares clocks.

The pong with the shortest round trip of the last `WINDOW` says most (as in NTP, RFC 5905, section 10): its answer was
given within half that round trip of the middle.
"""

from collections import deque

WINDOW = 32


class PageClock:
    """Estimates one page's clock."""

    def __init__(self) -> None:
        """Start without a pong."""
        self._pongs: deque[tuple[float, float]] = deque(maxlen=WINDOW)

    def pong(self, t_ms: float, page_ms: float, now_ms: float) -> None:
        """Take an answer to a ping.

        Args:
            t_ms: Our clock at the ping [ms].
            page_ms: The page's clock when it answered [ms].
            now_ms: Our clock at the pong [ms].
        """
        if t_ms <= now_ms:
            self._pongs.append((now_ms - t_ms, page_ms - 0.5 * (now_ms + t_ms)))

    @property
    def round_trip_ms(self) -> float | None:
        """The shortest round trip of late [ms]; None before the first pong."""
        return min(self._pongs)[0] if self._pongs else None

    def age_ms(self, page_ms: float, now_ms: float) -> float | None:
        """How old something is that has the page's time, to half a round trip [ms]; None before the first pong.

        Args:
            page_ms: The page's time [ms].
            now_ms: Our clock [ms].
        """
        return now_ms - (page_ms - min(self._pongs)[1]) if self._pongs else None
