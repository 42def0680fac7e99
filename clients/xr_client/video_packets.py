"""The video packet: a stereo image on its way to a page, and the acknowledgement that comes back.

| offset | type | field                                     |
|--------|------|-------------------------------------------|
| 0      | u8   | 0x56, "V"                                 |
| 1      | u8   | version, 1                                |
| 2      | u16  | 0                                         |
| 4      | u32  | sequence number                           |
| 8      | f64  | when it was taken, the server's clock [ms]|
| 16     | u32  | bytes of the left image                   |
| 20     | u32  | bytes of the right image                  |
| 24     |      | left image, then right image: JPEG        |

The page answers each image it has shown with a text: {"type": "shown", "seq": SEQ}. Little-endian. An image has at most
1 MiB; a packet that breaks these rules is a `VideoError` in one line.
"""

import math
import struct
from dataclasses import dataclass

from xr_client.messages import MessageError, read_object

MAGIC, VERSION = 0x56, 1
MAX_IMAGE_BYTES = 1 << 20
_HEAD = struct.Struct("<BBHIdII")


class VideoError(ValueError):
    """Bytes that are no video packet; says why, in one line."""


@dataclass(frozen=True, slots=True)
class StereoFrame:
    """An image for each eye.

    Attributes:
        seq: Its number.
        taken_ms: When it was taken, by the server's clock [ms].
        left: For the left eye, JPEG.
        right: For the right eye, JPEG.
    """

    seq: int
    taken_ms: float
    left: bytes
    right: bytes


def encode_frame(frame: StereoFrame) -> bytes:
    """Write a video packet.

    Args:
        frame: The images.

    Raises:
        VideoError: An image is empty or too large, or the number or the time is out of range.
    """
    for image in (frame.left, frame.right):
        if not 0 < len(image) <= MAX_IMAGE_BYTES:
            raise VideoError(f"an image has 1 to {MAX_IMAGE_BYTES} bytes, not {len(image)}")
    if not (0 <= frame.seq < 2**32 and math.isfinite(frame.taken_ms)):
        raise VideoError("a video packet's number must be from 0 to 2^32 - 1, and its time finite")
    head = _HEAD.pack(MAGIC, VERSION, 0, frame.seq, frame.taken_ms, len(frame.left), len(frame.right))
    return head + frame.left + frame.right


def decode_frame(data: bytes) -> StereoFrame:
    """Read a video packet.

    Args:
        data: The bytes of one packet.

    Raises:
        VideoError: They are none.
    """
    if len(data) < _HEAD.size:
        raise VideoError(f"a video packet has at least {_HEAD.size} bytes, not {len(data)}")
    magic, version, padding, seq, taken_ms, left, right = _HEAD.unpack_from(data)
    if (magic, version, padding) != (MAGIC, VERSION, 0):
        raise VideoError(f"a video packet begins with {MAGIC:#04x} and version {VERSION}")
    if not (0 < left <= MAX_IMAGE_BYTES and 0 < right <= MAX_IMAGE_BYTES):
        raise VideoError(f"an image has 1 to {MAX_IMAGE_BYTES} bytes, not {left} and {right}")
    if len(data) != _HEAD.size + left + right or not math.isfinite(taken_ms):
        raise VideoError("a video packet's size must be that of its images, and its time finite")
    return StereoFrame(seq, taken_ms, data[_HEAD.size : _HEAD.size + left], data[_HEAD.size + left :])


def read_shown(text: str) -> int:
    """Read a page's acknowledgement.

    Args:
        text: The message.

    Returns:
        Number of the frame shown.

    Raises:
        MessageError: It is none.
    """
    fields = read_object(text)
    seq = fields.get("seq")
    if fields.keys() != {"type", "seq"} or fields["type"] != "shown" or type(seq) is not int or not 0 <= seq < 2**32:
        raise MessageError('an acknowledgement is {"type": "shown", "seq": SEQ}')
    return seq
