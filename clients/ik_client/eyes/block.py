"""A block of shared memory with the newest packet in it: one process writes, any number of processes read.

Nobody waits for anybody, and no reader ever takes half a packet for a whole one.

| offset | content                                                                             |
|--------|-------------------------------------------------------------------------------------|
| 0      | magic and version                                                                   |
| 8      | when a reader last looked [ns], `CLOCK_MONOTONIC`                                   |
| 16     | number of the newest packet, from 1; 0 before                                       |
| 24     | newest number of those that readers have who wait for a newer one                   |
| 64     | slot of the even numbers: number before, number after, bytes, CRC-32, then the data |
| ...    | slot of the odd numbers                                                             |

All are 64-bit words of the machine. A packet goes into the slot that is not the newest, so a reader has a whole period
to copy the other. The order of our writes is not relied on (processors with weak ordering show them in another): a
packet counts only if both its numbers are the one looked for, before and after copying, and its checksum is right,
which is seeded with that number. A word is written at once, and if a time of looking were torn it would be out of range
and count as nobody's.
"""

import mmap
import zlib

MAGIC = int.from_bytes(b"ik-eyes\x01", "little")
_BEAT, _NEWEST, _HAD = 1, 2, 3
_HEAD_BYTES, _SLOT_HEAD_BYTES = 64, 32
_BEFORE, _AFTER, _LENGTH, _CHECKSUM = range(4)


def block_bytes(capacity: int) -> int:
    """Size of a block for packets of up to so many bytes, a multiple of 8."""
    return _HEAD_BYTES + 2 * (_SLOT_HEAD_BYTES + capacity)


class PacketBlock:
    """One process's view of a block. Each process uses it in one thread."""

    def __init__(self, memory: mmap.mmap, capacity: int) -> None:
        """Look at a block.

        Args:
            memory: The block, of `block_bytes(capacity)` bytes.
            capacity: Largest packet [bytes], a multiple of 8.
        """
        self._memory = memory
        self._capacity = capacity
        self._bytes = memoryview(memory)
        self._words = self._bytes.cast("Q")

    def prepare(self) -> None:
        """Make an empty block one of this kind."""
        self._words[0] = MAGIC

    @property
    def valid(self) -> bool:
        """Whether this is a block of this kind."""
        return self._words[0] == MAGIC

    @property
    def newest(self) -> int:
        """Number of the newest packet; 0 where there is none yet."""
        return self._words[_NEWEST]

    @property
    def looked(self) -> int:
        """When a reader last looked [ns]; 0 before."""
        return self._words[_BEAT]

    @property
    def had(self) -> int:
        """The newest number of those that readers have who wait for a newer one; 0 where they have none."""
        return self._words[_HAD]

    def look(self, now_ns: int, have: int) -> None:
        """Say that a reader waits for a newer packet.

        Args:
            now_ns: `time.monotonic_ns()`.
            have: Number of the packet the reader has; 0 for none.
        """
        self._words[_BEAT] = now_ns
        # Two readers at once may lose one of their words: it is said again at the next look.
        if have > self._words[_HAD]:
            self._words[_HAD] = have

    def write(self, packet: bytes) -> None:
        """Put a packet in, as the newest.

        Args:
            packet: At most `capacity` bytes.
        """
        if len(packet) > self._capacity:
            raise ValueError(f"a packet has at most {self._capacity} bytes, not {len(packet)}")
        number = self.newest + 1
        slot, data = self._slot(number)
        self._words[slot + _BEFORE] = number
        self._words[slot + _LENGTH] = len(packet)
        self._words[slot + _CHECKSUM] = zlib.crc32(packet, number & 0xFFFFFFFF)
        self._bytes[data : data + len(packet)] = packet
        self._words[slot + _AFTER] = number
        self._words[_NEWEST] = number

    def read(self, number: int) -> bytes | None:
        """Copy a packet.

        Args:
            number: Its number, which was the newest a moment ago.

        Returns:
            The packet; None where it has been written over, or something else is there.
        """
        slot, data = self._slot(number)
        length = self._words[slot + _LENGTH]
        if not self._holds(slot, number) or length > self._capacity:
            return None
        checksum = self._words[slot + _CHECKSUM]
        packet = bytes(self._bytes[data : data + length])
        whole = self._holds(slot, number) and zlib.crc32(packet, number & 0xFFFFFFFF) == checksum
        return packet if whole else None

    def close(self) -> None:
        """Let go of the memory."""
        self._words.release()
        self._bytes.release()
        self._memory.close()

    def _holds(self, slot: int, number: int) -> bool:
        return self._words[slot + _BEFORE] == number == self._words[slot + _AFTER]

    def _slot(self, number: int) -> tuple[int, int]:
        """Where a packet's slot begins [words], and where its data do [bytes]."""
        start = _HEAD_BYTES + number % 2 * (_SLOT_HEAD_BYTES + self._capacity)
        return start // 8, start + _SLOT_HEAD_BYTES
