"""The stereo packet: what a robot's two eyes see, on its way to a person.

It is the same wherever it travels: from the robot through shared memory or Zenoh, and to the page in a headset.

| offset | type | field                                                               |
|--------|------|---------------------------------------------------------------------|
| 0      | u8   | 0x56, "V"                                                           |
| 1      | u8   | version, 1                                                          |
| 2      | u16  | vertical field of view [hundredths of a degree]; 0 where not known  |
| 4      | u32  | sequence number                                                     |
| 8      | f64  | when it was taken, by the sender's monotonic clock [ms]             |
| 16     | u32  | bytes of the left image                                             |
| 20     | u32  | bytes of the right image                                            |
| 24     |      | left image, then right image: JPEG                                  |

Little-endian. An image has at most 1 MiB, and the field of view is below 180 degrees; what breaks these rules is a
`StereoError` in one line.
"""

import math
import struct
from dataclasses import dataclass

MAGIC, VERSION = 0x56, 1
MAX_IMAGE_BYTES = 1 << 20
_HEAD = struct.Struct("<BBHIdII")
_FOV_END = 18_000

MAX_PACKET_BYTES = _HEAD.size + 2 * MAX_IMAGE_BYTES


class StereoError(ValueError):
    """What is no stereo packet, or cannot become one; says why, in one line."""


@dataclass(frozen=True, slots=True)
class StereoFrame:
    """An image for each eye.

    Attributes:
        seq: Its number.
        taken_ms: When it was taken, by the sender's monotonic clock [ms].
        left: For the left eye, JPEG.
        right: For the right eye, JPEG.
        fov_deg: Vertical field of view of both; 0 where it is not known [degree].
    """

    seq: int
    taken_ms: float
    left: bytes
    right: bytes
    fov_deg: float = 0.0


def encode_frame(frame: StereoFrame) -> bytes:
    """Write a stereo packet.

    Args:
        frame: The images; the field of view is rounded to a hundredth of a degree.

    Raises:
        StereoError: An image is empty or too large, or a number is out of range.
    """
    for image in (frame.left, frame.right):
        if not 0 < len(image) <= MAX_IMAGE_BYTES:
            raise StereoError(f"an image has 1 to {MAX_IMAGE_BYTES} bytes, not {len(image)}")
    if not (0 <= frame.seq < 2**32 and math.isfinite(frame.taken_ms)):
        raise StereoError("a stereo packet's number must be from 0 to 2^32 - 1, and its time finite")
    fov = round(100.0 * frame.fov_deg) if math.isfinite(frame.fov_deg) else _FOV_END
    if not 0 <= fov < _FOV_END:
        raise StereoError(f"a field of view must be from 0 to below 180 degrees, not {frame.fov_deg:g}")
    head = _HEAD.pack(MAGIC, VERSION, fov, frame.seq, frame.taken_ms, len(frame.left), len(frame.right))
    return head + frame.left + frame.right


def decode_frame(data: bytes) -> StereoFrame:
    """Read a stereo packet.

    Args:
        data: The bytes of one packet.

    Raises:
        StereoError: They are none.
    """
    if len(data) < _HEAD.size:
        raise StereoError(f"a stereo packet has at least {_HEAD.size} bytes, not {len(data)}")
    magic, version, fov, seq, taken_ms, left, right = _HEAD.unpack_from(data)
    if (magic, version) != (MAGIC, VERSION):
        raise StereoError(f"a stereo packet begins with {MAGIC:#04x} and version {VERSION}")
    if fov >= _FOV_END:
        raise StereoError(f"a field of view must be below 180 degrees, not {fov / 100.0:g}")
    if not (0 < left <= MAX_IMAGE_BYTES and 0 < right <= MAX_IMAGE_BYTES):
        raise StereoError(f"an image has 1 to {MAX_IMAGE_BYTES} bytes, not {left} and {right}")
    if len(data) != _HEAD.size + left + right or not math.isfinite(taken_ms):
        raise StereoError("a stereo packet's size must be that of its images, and its time finite")
    end = _HEAD.size + left
    return StereoFrame(seq, taken_ms, data[_HEAD.size : end], data[end:], fov / 100.0)
