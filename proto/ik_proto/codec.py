"""Bytes and documents: JSON for TCP, MessagePack for Zenoh. Knows nothing of what a message means.

Arrays travel as nested lists in JSON, and as raw little-endian float64 in row-major order (`bin`) in MessagePack, which
costs a third of a list.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgpack
import numpy as np
import orjson

from ik_proto.errors import DecodeError
from ik_proto.limits import MAX_BATCH
from ik_proto.messages import Document

_FLOAT64 = np.dtype("<f8")
_MAX_ARRAY = 2 * MAX_BATCH
"""Longest MessagePack array. Memory for one is taken when its length is read, before its entries: a nest of arrays that
lie about their length costs a thousand times this. No message has one longer than a batch."""


@dataclass(frozen=True, slots=True)
class Codec:
    """A pair of functions.

    Attributes:
        name: "json" or "msgpack".
        encode: Document to bytes.
        decode: Bytes to a document; raises `DecodeError` on anything else.
    """

    name: str
    encode: Callable[[Document], bytes]
    decode: Callable[[bytes], Document]


def _encode_json(document: Document) -> bytes:
    return orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)


def _decode_json(body: bytes) -> Document:
    try:
        document = orjson.loads(body)
    except orjson.JSONDecodeError as error:
        document = _lenient_json(body, error)
    return _mapping(document)


def _lenient_json(body: bytes, error: orjson.JSONDecodeError) -> Any:
    """Read what Python's own `json` writes for NaN and Infinity, so that validation can name the field at fault."""
    try:
        document = json.loads(body)
        # It also reads halves of surrogate pairs, which nothing can write again: not a reply, a log nor a terminal.
        json.dumps(document, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        raise DecodeError(f"not JSON: {error}") from None
    return document


def _encode_msgpack(document: Document) -> bytes:
    return msgpack.packb(document, default=_array_bytes)


def _array_bytes(value: Any) -> bytes:
    if isinstance(value, np.ndarray):
        return (
            value if value.dtype is _FLOAT64 else value.astype(_FLOAT64)
        ).tobytes()  # row-major, whatever its layout
    raise TypeError(f"cannot send a {type(value).__name__}")


def _decode_msgpack(body: bytes) -> Document:
    try:
        document = msgpack.unpackb(body, max_array_len=_MAX_ARRAY)
    except (ValueError, TypeError, msgpack.UnpackException, OverflowError) as error:
        raise DecodeError(f"not MessagePack: {error or type(error).__name__}") from None
    return _mapping(document)


def _mapping(document: Any) -> Document:
    if not isinstance(document, dict):
        raise DecodeError(f"a message is a mapping, not {type(document).__name__}")
    return document


JSON = Codec("json", _encode_json, _decode_json)
MSGPACK = Codec("msgpack", _encode_msgpack, _decode_msgpack)
