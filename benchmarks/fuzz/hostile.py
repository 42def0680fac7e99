"""Writers of JSON and MessagePack that say what no honest writer says.

Documents are Python values as a decoder gives them, and these besides:

- `Raw`: bytes that are put in as they are;
- `Pairs`: a mapping as a list of pairs, so that keys may repeat and need not be strings;
- NaN, infinities, lone surrogates and integers of any size.
"""

import json
import math
from collections.abc import Callable
from typing import Any

import msgpack
import numpy as np

Write = Callable[[Any], bytes]


class Raw(bytes):
    """Bytes that are put in as they are, whether they make sense or not."""


class Pairs(list):
    """A mapping as a list of pairs."""


def write_json(value: Any) -> bytes:
    """Write JSON, or nearly."""
    if isinstance(value, Raw):
        return bytes(value)
    if isinstance(value, Pairs):
        return b"{" + b",".join(write_json(key) + b":" + write_json(item) for key, item in value) + b"}"
    if isinstance(value, dict):
        return write_json(Pairs(value.items()))
    if isinstance(value, list | tuple):
        return b"[" + b",".join(map(write_json, value)) + b"]"
    if isinstance(value, bytes | np.ndarray):
        return write_json(list(value))
    if isinstance(value, str | float | int | None):
        return json.dumps(value).encode()
    return write_json(repr(value))


def write_msgpack(value: Any) -> bytes:
    """Write MessagePack, or nearly."""
    if isinstance(value, Raw):
        return bytes(value)
    if isinstance(value, Pairs):
        parts = (write_msgpack(part) for pair in value for part in pair)
        return msgpack.Packer().pack_map_header(len(value)) + b"".join(parts)
    if isinstance(value, dict):
        return write_msgpack(Pairs(value.items()))
    if isinstance(value, np.ndarray):
        return msgpack.packb(value.astype("<f8").tobytes())
    if isinstance(value, list) and not isinstance(value, msgpack.ExtType):
        return msgpack.Packer().pack_array_header(len(value)) + b"".join(map(write_msgpack, value))
    if isinstance(value, int) and not -(2**63) <= value < 2**64:
        return msgpack.packb(math.inf if value > 0 else -math.inf)
    return msgpack.packb(value, unicode_errors="surrogatepass")
