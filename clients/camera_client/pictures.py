"""Colour as JPEG, depth as 16-bit PNG, and back.

What comes from a file is looked at before it is decoded: a few bytes can claim to be a picture of a gigabyte.
"""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from camera_client.opencv import cv2

_QUALITY = 95
_PNG_MARK, _JPEG_MARK = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
_CHUNK = struct.Struct(">I4s")
_SIZE = struct.Struct(">II")
# Start of frame: SOF0 to SOF15 without DHT, JPG and DAC, which share the range.
_FRAME_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_SCAN = 0xDA


class PictureError(ValueError):
    """Not a picture of the kind and size that is expected; one line."""


def encode_colour(colour: NDArray[np.uint8]) -> bytes:
    """As a JPEG of quality 95, of red, green, blue, shape (height, width, 3)."""
    swapped = cv2.cvtColor(colour, cv2.COLOR_RGB2BGR)
    done, data = cv2.imencode(".jpg", swapped, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    assert done
    return data.tobytes()


def encode_depth(depth: NDArray[np.uint16]) -> bytes:
    """As a 16-bit PNG of one channel, of distances, shape (height, width) [mm]; nothing is lost."""
    # More effort makes it hardly smaller and takes far longer.
    done, data = cv2.imencode(".png", depth, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert done
    return data.tobytes()


def decode_colour(data: bytes, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Red, green, blue of a JPEG, shape (height, width, 3).

    Args:
        data: The JPEG.
        size: Width and height that it must have [pixel].

    Raises:
        PictureError: It is none, or has another size.
    """
    _expect(_jpeg_size(data), size, "JPEG")
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if picture is None:
        raise PictureError("a broken JPEG")
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)


def decode_depth(data: bytes, size: tuple[int, int]) -> NDArray[np.uint16]:
    """Distances of a 16-bit PNG of one channel, shape (height, width) [mm].

    Args:
        data: The PNG.
        size: Width and height that it must have [pixel].

    Raises:
        PictureError: It is none, or has another size or depth.
    """
    _expect(_png_size(data), size, "PNG")
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise PictureError("a broken PNG")
    if picture.dtype != np.uint16 or picture.ndim != 2:
        raise PictureError("a PNG that does not have one channel of 16 bits")
    return picture


def _expect(found: tuple[int, int] | None, size: tuple[int, int], kind: str) -> None:
    if found is None:
        raise PictureError(f"no whole {kind}")
    if found != size:
        raise PictureError(f"a {kind} of {found[0]} x {found[1]} pixels instead of {size[0]} x {size[1]}")


def _png_size(data: bytes) -> tuple[int, int] | None:
    """Width and height of a PNG all of whose chunks are whole; None of anything else."""
    if not data.startswith(_PNG_MARK):
        return None
    at, size = len(_PNG_MARK), None
    while at + _CHUNK.size <= len(data):
        length, kind = _CHUNK.unpack_from(data, at)
        end = at + _CHUNK.size + length
        if end + 4 > len(data) or zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            return None
        if size is None:
            if kind != b"IHDR" or length < _SIZE.size:
                return None
            size = _SIZE.unpack_from(data, at + _CHUNK.size)
        if kind == b"IEND":
            return size
        at = end + 4
    return None


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Width and height of a JPEG that has a beginning and an end; None of anything else."""
    if not (data.startswith(_JPEG_MARK) and data.rstrip(b"\0").endswith(b"\xff\xd9")):
        return None
    at = len(_JPEG_MARK)
    while at + 9 <= len(data) and data[at] == 0xFF:
        kind = data[at + 1]
        if kind in _FRAME_SIZES:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        if kind == _SCAN:
            return None
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
