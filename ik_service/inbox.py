"""What one connection has sent and is still to be answered, in order. Pure: bytes in, requests out.

What the network brought is cut into frames only as fast as they are taken, so a flood of tiny frames costs no more
memory than it brings, and never much time at once.
"""

from collections import deque
from collections.abc import Callable

from ik_proto import FrameDecoder, FrameTooLarge
from ik_service.stream_queue import StreamQueue, Waiting

_SLICE_BYTES = 16 * 1024
"""Cut at a time: some ten requests, or a few thousand of the smallest frames there are, in less than a millisecond."""


class Inbox:
    """The requests of one connection.

    Attributes:
        fault: A length beyond the limit; nothing behind it can be followed.
    """

    def __init__(self, stream_of: Callable[[bytes], str], most: int, most_bytes: int) -> None:
        """Start empty.

        Args:
            stream_of: Tells the stream of a body; empty for none.
            most: Requests that may wait before it is full.
            most_bytes: The same [bytes].
        """
        self.fault: FrameTooLarge | None = None
        self._most = most
        self._most_bytes = most_bytes
        self._decoder = FrameDecoder()
        self._uncut: deque[tuple[bytes, float]] = deque()
        self._cut_to = 0  # how much of the oldest of these is cut
        self._queue = StreamQueue(stream_of)

    def __len__(self) -> int:
        """Number of requests that wait."""
        return len(self._queue)

    @property
    def full(self) -> bool:
        """Whether to bring no more for now."""
        return bool(self._uncut) or self._no_room()

    @property
    def begun(self) -> bool:
        """Whether a frame has begun and the rest of it has not come yet."""
        return not self._uncut and self._decoder.pending

    def feed(self, data: bytes, arrived: float) -> None:
        """Take what the network brought.

        Args:
            data: Any number of bytes.
            arrived: When they came [s].
        """
        if not self._uncut and len(data) <= _SLICE_BYTES and not self._no_room():
            self._cut(data, arrived)
        else:
            self._uncut.append((data, arrived))
            self._cut_some()

    def take(self) -> Waiting:
        """Take the oldest request.

        Raises:
            IndexError: None waits.
        """
        oldest = self._queue.take()
        if self._uncut:
            self._cut_some()
        return oldest

    def mark(self) -> list[str]:
        """Mark what newer requests have superseded.

        Returns:
            The streams of those that came since the last time.
        """
        return self._queue.mark()

    def clear(self) -> None:
        """Forget everything."""
        self._uncut.clear()
        self._queue.clear()

    def _no_room(self) -> bool:
        return len(self._queue) >= self._most or self._queue.size > self._most_bytes

    def _cut_some(self) -> None:
        """Cut until there is no room."""
        while self._uncut and not self._no_room() and self.fault is None:
            data, arrived = self._uncut[0]
            begin, self._cut_to = self._cut_to, self._cut_to + _SLICE_BYTES
            if self._cut_to >= len(data):
                self._uncut.popleft()
                self._cut_to = 0
            self._cut(data[begin : begin + _SLICE_BYTES], arrived)

    def _cut(self, data: bytes, arrived: float) -> None:
        try:
            bodies = self._decoder.feed(data)
        except FrameTooLarge as error:
            bodies, self.fault = error.frames_before, error
            self._uncut.clear()
        for body in bodies:
            self._queue.put(Waiting(body, arrived))
