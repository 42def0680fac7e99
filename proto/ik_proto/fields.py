"""Readers of single fields, shared by requests and replies.

Each returns a trusted value or raises `ValueError` with one line.
"""

import math
from itertools import chain
from typing import Any

import numpy as np

from ik_proto.limits import MAX_ID
from ik_proto.messages import Array, Document

_FLOAT64 = np.dtype("<f8")
_ROWS = frozenset({list, tuple, np.ndarray})
ANY_FINITE = 1e150
"""Norms are compared to find NaN, Inf and nonsense in one call."""


def read_array(document: Document, name: str, shape: tuple[int, ...], bound: float = ANY_FINITE) -> Array:
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
    value = document.get(name)
    if type(value) is list:
        array, norm = _from_list(value, name, shape)
    else:
        array = read_shaped(document, name, shape)
        norm = math.hypot(*array.ravel().tolist())
    if not norm <= bound:  # written so that NaN fails
        raise ValueError(f"{name} {beyond(array, bound)}")
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
    if type(value) is bytes:
        if len(value) != 8 * math.prod(shape):
            raise ValueError(f"{name} must be raw float64 of shape {_words(shape)}, {len(value)} bytes came")
        return np.ndarray(shape, _FLOAT64, value)
    if value is None:
        raise ValueError(f"{name} is missing")
    if type(value) is list:
        return _from_list(value, name, shape)[0]
    return as_floats(value, name, shape)


def as_floats(value: Any, name: str, shape: tuple[int, ...]) -> Array:
    """Take a value as an array.

    Args:
        value: An array, or nested lists that are known to hold no strings: of one long string among many short ones
            numpy makes an array of strings as long as the longest, so gigabytes from a message of kilobytes.
        name: Its field.
        shape: The shape it must have.

    Returns:
        A float64 array of that shape.

    Raises:
        ValueError: Not numbers, or of another shape.
    """
    try:
        array = np.array(value)
    except (ValueError, TypeError, OverflowError):
        raise no_array(value, name, shape) from None
    if array.shape != shape:
        raise no_array(value, name, shape)
    if array.dtype is _FLOAT64:
        return array
    if array.dtype.kind not in "fiu":
        raise no_array(value, name, shape)
    return array.astype(np.float64)


def beyond(array: Array, bound: float) -> str:
    """Say what is wrong with an array whose norm is not within a bound."""
    return f"is beyond {bound:g}" if np.isfinite(array).all() else "holds a number that is not finite"


def no_array(value: Any, name: str, shape: tuple[int, ...]) -> ValueError:
    """Say why a value is no array of a shape."""
    found = _shape(value)
    if found is None or found == shape:
        return ValueError(f"{name} must be an array of numbers with rows of one length")
    return ValueError(f"{name} must have shape {_words(shape)}, not {_words(found)}")


def _from_list(value: list[Any], name: str, shape: tuple[int, ...]) -> tuple[Array, float]:
    """The array in nested lists, and its norm."""
    numbers = value
    try:
        if len(numbers) != shape[0]:
            raise no_array(value, name, shape)
        for length in shape[1:]:
            if not set(map(type, numbers)) <= _ROWS or set(map(len, numbers)) != {length}:
                raise no_array(value, name, shape)
            numbers = list(chain.from_iterable(numbers))
        norm = math.hypot(*numbers)
    except (TypeError, OverflowError):
        raise no_array(value, name, shape) from None
    array = as_floats(numbers, name, (len(numbers),))
    return (array if len(shape) == 1 else array.reshape(shape)), norm


def _shape(value: Any, depth: int = 4) -> tuple[int, ...] | None:
    """Shape of an array or of nested lists that begin with a number; None where it is neither, or nested deeper."""
    if isinstance(value, np.ndarray):
        return value.shape
    if isinstance(value, float | int) and not isinstance(value, bool):
        return ()
    if not isinstance(value, list | tuple) or depth == 0:
        return None
    if not value:
        return (0,)
    row = _shape(value[0], depth - 1)
    if row and not all(type(other) in _ROWS and len(other) == row[0] for other in value):
        return None
    return None if row is None else (len(value), *row)


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
    if isinstance(value, bool) or not isinstance(value, int | float) or not -ANY_FINITE <= value <= ANY_FINITE:
        raise ValueError(f"{name} must be a finite number")
    return float(value)


def read_choice(document: Document, name: str, choices: tuple[str, ...], default: str | None) -> Any:
    """Read one of some words; absent or null gives the default.

    Raises:
        ValueError: Another word; the message names the choices.
    """
    value = document.get(name)
    if value is None:
        return default
    if value not in choices:
        what = f"{value[:40]!r} is not known" if isinstance(value, str) else "must be a string"
        raise ValueError(f"{name} {what}, there are {', '.join(choices)}")
    return value


def read_integer(document: Document, name: str, low: int, high: int, default: int | None = None) -> int:
    """Read an integer from a range; absent or null gives the default.

    Raises:
        ValueError: Not an integer, out of range, or absent without a default.
    """
    value = document.get(name)
    if value is None and default is not None:
        return default
    if type(value) is not int or not low <= value <= high:  # bool is an int, and no number
        raise ValueError(f"{name} must be an integer from {low} to {high}")
    return value


def read_two_words(document: Document, name: str, choices: tuple[str, ...] | None) -> Any:
    """Read two words, of the left and of the right arm.

    Args:
        document: The message.
        name: Its field.
        choices: What each may be; None for any name, or null.

    Raises:
        ValueError: Not two of these.
    """
    words = document.get(name)
    if not isinstance(words, list) or len(words) != 2:
        raise ValueError(f"{name} must be two words")
    if choices is not None and not all(word in choices for word in words):
        raise ValueError(f"{name} must be of {', '.join(repr(choice) for choice in choices)}")
    if choices is None and not all(word is None or isinstance(word, str) for word in words):
        raise ValueError(f"{name} must be two names, or null")
    return words[0], words[1]
