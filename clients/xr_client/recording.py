"""Recorded sessions: the packets of a headset and when they arrived, in a file.

A recording of ours (`.ikxr`), little-endian:

| type      | field                                                        |
|-----------|--------------------------------------------------------------|
| 4 bytes   | "IKXR"                                                       |
| u32       | version, 1                                                   |
| f64       | arrival of a packet since the beginning [s], never sinking   |
| u32       | size of the packet                                           |
|           | the packet, as `packets` has it; then the next arrival       |

A file that ends within a record was cut off; what came before counts. Anything else that is not as above is refused, as
a `RecordingError` in one line.

Sessions of WebXR poses in a NumPy archive (`.npz`) are read as well: `head`, `left`, `right`, each [T, 4, 4] [m] in
WebXR's axes, and their times `t_head`, `t_left`, `t_right`, each [T] [s]. They become packets of two controllers. Such
a file knows no grip, so the operator is made to grip, letting go for a moment every two seconds.
"""

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO
from zipfile import BadZipFile

import numpy as np

from ik_proto import Array
from xr_client.frames import quaternion_of
from xr_client.packets import MAX_PACKET_BYTES, HandPacket, Kind, PacketError, PosePacket, decode_packet

MAGIC, VERSION = b"IKXR", 1
GRIP_PERIOD, GRIP_PAUSE = 2.0, 0.2
"""How often the operator of an archive lets go, and for how long [s]."""

_HEAD = struct.Struct("<4sI")
_RECORD = struct.Struct("<dI")
_PARTS = ("head", "left", "right")


class RecordingError(ValueError):
    """A file that is no recording; says why, in one line."""


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """A packet of a recording.

    Attributes:
        time: When it arrived, since the beginning [s].
        packet: The packet.
    """

    time: float
    packet: PosePacket


class Recorder:
    """Writes packets to a file as they arrive."""

    def __init__(self, file: BinaryIO) -> None:
        """Begin a recording.

        Args:
            file: Where to write; who opened it closes it.
        """
        self._file = file
        self._begin: float | None = None
        file.write(_HEAD.pack(MAGIC, VERSION))

    def write(self, data: bytes, now: float) -> None:
        """Add a packet.

        Args:
            data: Its bytes, as they were accepted.
            now: When it arrived [s], monotonic.
        """
        if self._begin is None:
            self._begin = now
        self._file.write(_RECORD.pack(now - self._begin, len(data)) + data)


def read_recording(path: Path) -> list[Recorded]:
    """Read a recorded session.

    Args:
        path: `.npz`: an archive of WebXR poses. Any other name: a recording of ours.

    Returns:
        Its packets, in order of arrival, at least one.

    Raises:
        RecordingError: The file cannot be read, or is no recording.
    """
    try:
        packets = _from_archive(path) if path.suffix == ".npz" else list(_from_records(path))
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}") from None
    if not packets:
        raise RecordingError(f"{path} holds no packet")
    return packets


def _from_records(path: Path) -> Iterator[Recorded]:
    with path.open("rb") as file:
        head = file.read(_HEAD.size)
        if head != _HEAD.pack(MAGIC, VERSION):
            raise RecordingError(f"{path} is no recording of ik-xr in version {VERSION}")
        last, number = 0.0, 0
        while len(record := file.read(_RECORD.size)) == _RECORD.size:
            time, size = _RECORD.unpack(record)
            if not (last <= time < math.inf and size <= MAX_PACKET_BYTES):
                raise RecordingError(f"packet {number} of {path} has an impossible time or size")
            data = file.read(size)
            if len(data) < size:
                return
            try:
                yield Recorded(time, decode_packet(data))
            except PacketError as error:
                raise RecordingError(f"packet {number} of {path}: {error}") from None
            last, number = time, number + 1


def _from_archive(path: Path) -> list[Recorded]:
    try:
        with path.open("rb") as file, np.load(file) as archive:
            poses = {part: np.asarray(archive[part], dtype=np.float64) for part in _PARTS}
            times = {part: np.asarray(archive[f"t_{part}"], dtype=np.float64) for part in _PARTS}
    except (KeyError, TypeError, ValueError, EOFError, BadZipFile):
        raise RecordingError(f"{path} is no archive with head, left, right and their times t_head, ...") from None
    for part in _PARTS:
        T, t = poses[part], times[part]
        shaped = t.ndim == 1 and len(t) > 0 and T.shape == (len(t), 4, 4)
        if not (shaped and np.isfinite(T).all() and np.isfinite(t).all() and (np.diff(t) >= 0.0).all()):
            raise RecordingError(f"{part} of {path} must be finite poses [T, 4, 4] with times [T] that never sink")
    begin = times["head"][0]
    recorded = []
    for seq, time in enumerate(times["head"]):
        grip = 1.0 if (time - begin) % GRIP_PERIOD > GRIP_PAUSE else 0.0
        head, left, right = (_pose_at(poses[part], times[part], time) for part in _PARTS)
        packet = PosePacket(
            seq=seq,
            epoch=0,
            capture_ms=float(time * 1e3),
            head=head,
            left=_controller(left, grip),
            right=_controller(right, grip),
        )
        recorded.append(Recorded(float(time - begin), packet))
    return recorded


def _pose_at(poses: Array, times: Array, time: float) -> Array | None:
    """Position and quaternion xyzw of the latest pose, shape (7,); None before the first."""
    k = int(np.searchsorted(times, time, side="right")) - 1
    return None if k < 0 else np.concatenate([poses[k, :3, 3], quaternion_of(poses[k, :3, :3])])


def _controller(pose: Array | None, grip: float) -> HandPacket:
    return HandPacket(Kind.CONTROLLER, pose, squeeze=grip)
