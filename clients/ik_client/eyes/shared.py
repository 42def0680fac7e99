"""Eye images through shared memory, between processes of one user on one machine.

Both ends read the same clock, so the age of a picture is known at either. A watcher says that it watches by writing
the time at which it last looked; one that is killed has looked long ago, and nothing else is left of it.
"""

import os
import time
from types import TracebackType
from typing import Self

from ik_client.eyes import block_file
from ik_client.eyes.block import PacketBlock, block_bytes
from ik_client.eyes.errors import EyesError
from ik_proto.stereo_packet import MAX_PACKET_BYTES, StereoError, StereoFrame, decode_frame, encode_frame

WATCHED_FOR = 1.0
"""How long a look counts [s]."""

_CAPACITY = -(-MAX_PACKET_BYTES // 8) * 8
_SIZE = block_bytes(_CAPACITY)
_POLL = 0.002
"""Time between two looks [s]: half of it is what shared memory adds to a picture's age."""

_CHECK_AFTER = 0.2
"""Time without a picture after which a watcher asks whether there is still a publisher [s]."""


class SharedEyes:
    """A watcher's end; fits `EyeSource`."""

    same_clock = True

    def __init__(self, name: str) -> None:
        """Begin to watch.

        Args:
            name: Of the block.

        Raises:
            EyesError: There is no such block, or it is not of this user; says what to do.
        """
        self.url = f"shm:{name}"
        try:
            self._descriptor = block_file.attach(name, _SIZE)
        except block_file.BlockError as error:
            raise EyesError(self.url, str(error)) from None
        self._block = PacketBlock(block_file.map_block(self._descriptor, _SIZE), _CAPACITY)
        if not self._block.valid:
            self.close()
            raise EyesError(self.url, "it is of another version")
        # What is there now may have been taken when somebody last watched, an hour ago.
        self._number = self._block.newest
        self._frame: StereoFrame | None = None

    def wait(self, after_seq: int, timeout: float) -> StereoFrame | None:
        """Wait for a newer picture; see `EyeSource`."""
        now = time.monotonic()
        end, check = now + timeout, now + _CHECK_AFTER
        while True:
            self._block.look(time.monotonic_ns(), self._number)
            self._take()
            if self._frame is not None and self._frame.seq != after_seq:
                return self._frame
            now = time.monotonic()
            if now >= check:
                if not block_file.held(self._descriptor):
                    raise EyesError(self.url, "the robot sends no pictures any more")
                check = now + _CHECK_AFTER
            if now >= end:
                return None
            time.sleep(min(_POLL, end - now))

    def close(self) -> None:
        """Stop watching."""
        self._block.close()
        os.close(self._descriptor)

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop watching."""
        self.close()

    def _take(self) -> None:
        """Take the newest picture, if it is another than before and whole."""
        newest = self._block.newest
        if newest == self._number:
            return
        packet = self._block.read(newest)
        if packet is None:
            return  # it has just been replaced: the next look finds its successor
        self._number = newest
        try:
            self._frame = decode_frame(packet)
        except StereoError:  # whoever wrote it speaks another language
            raise EyesError(self.url, "it holds something else than pictures") from None


class SharedEyePublisher:
    """A robot's end; fits `EyePublisher`."""

    def __init__(self, name: str) -> None:
        """Make the block; blocks that killed publishers left behind are removed.

        Args:
            name: Of the block.

        Raises:
            EyesError: Another process publishes there, or there is no memory.
        """
        block_file.sweep()
        self._path = block_file.folder() / name
        try:
            self._descriptor = block_file.create(name, _SIZE)
        except block_file.BlockError as error:
            raise EyesError(f"shm:{name}", str(error)) from None
        self._block = PacketBlock(block_file.map_block(self._descriptor, _SIZE), _CAPACITY)
        self._block.prepare()

    @property
    def watched(self) -> bool:
        """Whether somebody has looked lately."""
        return 0 <= time.monotonic_ns() - self._block.looked < WATCHED_FOR * 1e9

    @property
    def wanted(self) -> bool:
        """Whether somebody waits for a picture after the last."""
        return self.watched and self._block.had >= self._block.newest

    def publish(self, frame: StereoFrame) -> None:
        """Put a picture into the block."""
        self._block.write(encode_frame(frame))

    def close(self) -> None:
        """Remove the block; a second call does nothing."""
        if self._descriptor >= 0:
            self._block.close()
            block_file.remove(self._descriptor, self._path)
            self._descriptor = -1
