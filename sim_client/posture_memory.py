"""The robot's posture in shared memory: its control tick writes, the process that draws its eyes' view reads.

The memory has no name, so nothing can be left behind: the reader inherits its file. Writing takes microseconds and
waits for nobody; what is read is whole, or is not taken (see `ik_client.eyes.block`).
"""

import mmap
import os
import tempfile
from dataclasses import dataclass

import numpy as np

from ik_client.eyes.block import PacketBlock, block_bytes
from ik_client.eyes.block_file import folder
from ik_proto import Array


@dataclass(frozen=True, slots=True, eq=False)
class Posture:
    """Where the joints were.

    Attributes:
        time: When, monotonic [s].
        qpos: Positions of all joints of the model, shape (nq,) [rad].
    """

    time: float
    qpos: Array


class PostureMemory:
    """Holds the newest posture.

    Attributes:
        descriptor: The file, for a child process to inherit.
    """

    def __init__(self, nq: int, descriptor: int | None = None) -> None:
        """Make the memory, or look at that of the parent process.

        Args:
            nq: Number of joint positions.
            descriptor: The parent's; None to make one.
        """
        capacity = 8 * (1 + nq)
        size = block_bytes(capacity)
        if descriptor is None:
            with tempfile.TemporaryFile(dir=folder()) as file:
                descriptor = os.dup(file.fileno())
            os.ftruncate(descriptor, size)
        self.descriptor = descriptor
        self._nq = nq
        self._block = PacketBlock(mmap.mmap(descriptor, size), capacity)

    def write(self, posture: Posture) -> None:
        """Put in a posture, as the newest."""
        self._block.write(np.concatenate(([posture.time], posture.qpos)).tobytes())

    def read(self) -> Posture | None:
        """The newest posture; None where there is none yet, or it is just being replaced."""
        number = self._block.newest
        packet = self._block.read(number) if number else None
        if packet is None or len(packet) != 8 * (1 + self._nq):
            return None
        values = np.frombuffer(packet)
        return Posture(float(values[0]), values[1:])

    def close(self) -> None:
        """Let go of the memory."""
        self._block.close()
        os.close(self.descriptor)
