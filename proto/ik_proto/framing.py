"""Frames on a byte stream: a 4-byte big-endian length, then that many bytes. Pure: bytes in, frames out, no socket."""

import struct

from ik_proto.errors import FrameTooLarge
from ik_proto.limits import MAX_FRAME_BYTES

_LENGTH = struct.Struct(">I")
HEADER_BYTES = _LENGTH.size


def encode_frame(body: bytes) -> bytes:
    """Put the length in front of a body, as one string so that one write sends it."""
    return _LENGTH.pack(len(body)) + body


class FrameDecoder:
    """Cuts a stream into frames, however the network chopped it.

    A length is checked before its body is stored, so a stream costs at most one frame of memory beyond what was fed.
    After `FrameTooLarge` the stream has lost its rhythm: answer, then close it.
    """

    def __init__(self, limit: int = MAX_FRAME_BYTES) -> None:
        """Start at a frame boundary.

        Args:
            limit: Largest body accepted [bytes].
        """
        self._limit = limit
        self._pending = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Take what the network brought.

        Args:
            data: Any number of bytes.

        Returns:
            The bodies completed by it, oldest first.

        Raises:
            FrameTooLarge: A length beyond the limit was announced; the error carries the bodies completed before it.
        """
        if self._pending:
            self._pending += data
            data = bytes(self._pending) if self._complete() else b""
            if not data:
                return []
        frames: list[bytes] = []
        start, end = 0, len(data)
        while end - start >= HEADER_BYTES:
            body, length = start + HEADER_BYTES, self._length(data, start, frames)
            if end - body < length:
                break
            frames.append(data[body : body + length])
            start = body + length
        self._pending = bytearray(data[start:])
        return frames

    @property
    def pending(self) -> bool:
        """Whether a frame has begun and is not complete."""
        return bool(self._pending)

    def _complete(self) -> bool:
        """Whether the pending bytes hold a whole frame: spares copying them for every fragment that arrives."""
        have = len(self._pending)
        return have >= HEADER_BYTES and have - HEADER_BYTES >= self._length(self._pending, 0, [])

    def _length(self, data: bytes | bytearray, at: int, before: list[bytes]) -> int:
        (length,) = _LENGTH.unpack_from(data, at)
        if length > self._limit:
            self._pending = bytearray()
            raise FrameTooLarge(length, self._limit, before)
        return length
