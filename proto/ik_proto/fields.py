"""Readers of single fields, shared by requests and replies.

Each returns a trusted value or raises `ValueError` with one line.
"""

import math
from typing import Any

import numpy as np

from ik_proto.limits import MAX_ID
from ik_proto.messages import Array, Document

_FLOAT64 = np.dtype("<f8")
_ANY_FINITE = 1e150
"""Norms are compared to find NaN, Inf and nonsense in one call."""


def read_array(document: Document, name: str, shape: tuple[int, ...], bound: float = _ANY_FINITE) -> Array:
    """Read a required array of a known shape.

    Args:
        document: The message.
        name: Its field.
        shape: The shape it must have.
        bound: Largest Euclidean norm of all its entries.

    Returns:
        A float64 array of that shape, finite; read-only where it shares the message's memory.

    Raises:
        ValueError: Missing, not numbers, of another shape, not finite, or beyond the bound.
    """
    array = read_shaped(document, name, shape)
    if not math.hypot(*array.ravel().tolist()) <= bound:  # written so that NaN fails
        finite = bool(np.isfinite(array).all())
        raise ValueError(f"{name} is beyond {bound:g}" if finite else f"{name} holds a number that is not finite")
    return array


def read_shaped(document: Document, name: str, shape: tuple[int, ...]) -> Array:
    """Read a required array of a known shape, whatever its numbers.

    Args:
        document: The message.
        name: Its field.
        shape: The shape it must have.

    Returns:
        A float64 array of that shape; it may hold NaN.

    Raises:
        ValueError: Missing, not numbers, or of another shape.
    """
    value = document.get(name)
    if value is None:
        raise ValueError(f"{name} is missing")
    if type(value) is bytes:
        return _from_bytes(value, name, shape)
    array = _from_list(value, name)
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {_words(shape)}, not {_words(array.shape)}")
    return array


def _from_list(value: Any, name: str) -> Array:
    try:
        array = np.array(value)
    except (ValueError, TypeError, OverflowError):
        raise ValueError(f"{name} must be an array of numbers with rows of one length") from None
    if array.dtype is _FLOAT64:
        return array
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} must be an array of numbers")
    return array.astype(np.float64)


def _from_bytes(value: bytes, name: str, shape: tuple[int, ...]) -> Array:
    if len(value) != 8 * math.prod(shape):
        raise ValueError(f"{name} must be raw float64 of shape {_words(shape)}, {len(value)} bytes came")
    return np.ndarray(shape, _FLOAT64, value)


def _words(shape: tuple[int, ...]) -> str:
    return "x".join(map(str, shape)) or "of a single number"


def read_id(document: Document) -> int:
    """Read the optional id, 0 where it is absent.

    Raises:
        ValueError: Not an integer from 0 to 2^53 - 1.
    """
    value = document.get("id", 0)
    if type(value) is not int or not 0 <= value <= MAX_ID:  # bool is an int, and no id
        raise ValueError("id must be an integer from 0 to 2^53 - 1")
    return value


def read_text(document: Document, name: str, default: str | None = None) -> str:
    """Read a string; absent or null gives the default.

    Raises:
        ValueError: Not a string, or absent without a default.
    """
    value = document.get(name)
    if value is None and default is not None:
        return default
    if not isinstance(value, str):
        raise ValueError(f"{name} must be a string")
    return value


def read_number(document: Document, name: str) -> float:
    """Read a finite number.

    Raises:
        ValueError: Absent, not a number or not finite.
    """
    value = document.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not -_ANY_FINITE <= value <= _ANY_FINITE:
        raise ValueError(f"{name} must be a finite number")
    return float(value)
