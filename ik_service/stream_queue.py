"""Requests that wait for their turn, and which of them a newer one of the same stream has superseded.

Pure. A request that is taken before another has come is never looked at for its stream.
"""

from collections import deque
from collections.abc import Callable


class Waiting:
    """A request that waits.

    Attributes:
        body: As it came.
        arrived: When its last byte came [s].
        asker: Whom to answer, where a queue serves several.
        superseded: Whether a newer one of its stream waits too.
        stream: Its stream, once it has been looked at; empty for none.
    """

    __slots__ = ("arrived", "asker", "body", "stream", "superseded")

    def __init__(self, body: bytes, arrived: float, asker: object = None) -> None:
        """Start not superseded."""
        self.body = body
        self.arrived = arrived
        self.asker = asker
        self.superseded = False
        self.stream = ""


class StreamQueue:
    """First in, first out, with marks.

    Attributes:
        size: All bodies that wait together [bytes].
    """

    def __init__(self, stream_of: Callable[[bytes], str]) -> None:
        """Start empty.

        Args:
            stream_of: Tells the stream of a body; empty for none.
        """
        self.size = 0
        self._stream_of = stream_of
        self._waiting: deque[Waiting] = deque()
        self._unmarked: list[Waiting] = []
        self._newest: dict[str, Waiting] = {}

    def __len__(self) -> int:
        """Number of requests that wait."""
        return len(self._waiting)

    def put(self, new: Waiting) -> None:
        """Add the newest request."""
        self._waiting.append(new)
        self._unmarked.append(new)
        self.size += len(new.body)

    def take(self) -> Waiting:
        """Take the oldest request.

        Raises:
            IndexError: None waits.
        """
        if len(self._waiting) > 1:
            self.mark()
        else:
            self._unmarked.clear()
        oldest = self._waiting.popleft()
        self.size -= len(oldest.body)
        if oldest.stream and self._newest.get(oldest.stream) is oldest:
            del self._newest[oldest.stream]
        return oldest

    def take_superseded(self) -> list[Waiting]:
        """Take all that are superseded, the oldest first."""
        if len(self._waiting) < 2:
            return []
        self.mark()
        taken = [old for old in self._waiting if old.superseded]
        if taken:
            self._waiting = deque(kept for kept in self._waiting if not kept.superseded)
            self.size = sum(len(kept.body) for kept in self._waiting)
        return taken

    def mark(self) -> list[str]:
        """Mark what newer requests have superseded.

        Returns:
            The streams of those that came since the last time.
        """
        streams: list[str] = []
        for new in self._unmarked:
            new.stream = self._stream_of(new.body)
            if new.stream:
                if (older := self._newest.get(new.stream)) is not None:
                    older.superseded = True
                self._newest[new.stream] = new
                streams.append(new.stream)
        self._unmarked.clear()
        return streams

    def clear(self) -> None:
        """Forget everything."""
        self._waiting.clear()
        self._unmarked.clear()
        self._newest.clear()
        self.size = 0
