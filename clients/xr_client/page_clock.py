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
        # Round trip and lead of the best one [ms]; replaced as a whole, so that any thread may look.
        self._best: tuple[float, float] | None = None

    def pong(self, t_ms: float, page_ms: float, now_ms: float) -> None:
        """Take an answer to a ping.

        Args:
            t_ms: Our clock at the ping [ms].
            page_ms: The page's clock when it answered [ms].
            now_ms: Our clock at the pong [ms].
        """
        if t_ms <= now_ms:
            self._pongs.append((now_ms - t_ms, page_ms - 0.5 * (now_ms + t_ms)))
            self._best = min(self._pongs)

    @property
    def round_trip_ms(self) -> float | None:
        """The shortest round trip of late [ms]; None before the first pong."""
        best = self._best
        return best[0] if best else None

    def age_ms(self, page_ms: float, now_ms: float) -> float | None:
        """How old something is that has the page's time, to half a round trip [ms]; None before the first pong.

        Args:
            page_ms: The page's time [ms].
            now_ms: Our clock [ms].
        """
        best = self._best
        return now_ms - (page_ms - best[1]) if best else None
