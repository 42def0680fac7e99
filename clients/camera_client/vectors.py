"""Small vector algebra on arrays of shape (..., 3), without the overhead of numpy's general routines."""

import math

import numpy as np

from ik_proto import Array

_TINY = 1e-9
_NEXT = np.array([1, 2, 0])
"""After x comes y, after y z, after z x."""


def cross(a: Array, b: Array) -> Array:
    """Cross products, shape (..., 3)."""
    # What is taken from x and y is z of the product, and so on round.
    return (a * b.take(_NEXT, axis=-1) - a.take(_NEXT, axis=-1) * b).take(_NEXT, axis=-1)


def dot(a: Array, b: Array) -> Array:
    """Dot products, shape (...)."""
    return np.vecdot(a, b)


def length(a: Array) -> Array:
    """Euclidean lengths, shape (...)."""
    return np.sqrt(np.vecdot(a, a))


def unit(a: Array) -> Array:
    """Vectors of length 1; one of length 0 stays."""
    return a / np.maximum(length(a), _TINY)[..., None]


def between(a: Array, b: Array) -> Array:
    """The middle of two points."""
    return 0.5 * (a + b)


def middle(values: Array) -> float:
    """Median of the finite ones of a few numbers; NaN where there is none."""
    finite = np.sort(values[np.isfinite(values)])
    n = len(finite)
    return float(0.5 * (finite[(n - 1) // 2] + finite[n // 2])) if n else math.nan


def transport(v: Array, a: Array, b: Array) -> Array:
    """Turn v by the smallest rotation that takes unit vector a to unit vector b, shape (..., 3).

    For opposite a and b there is no smallest one; v is then only kept perpendicular to the turn that was meant.
    """
    c = cross(a, b)
    cv = cross(c, v)
    return v + cv + cross(c, cv) / np.maximum(1.0 + dot(a, b), _TINY)[..., None]


def rotate(v: Array, turn: Array) -> Array:
    """Rotate v by rotation vectors, shape (..., 3) [rad] (Rodrigues)."""
    angle = length(turn)[..., None]
    axis = turn / np.maximum(angle, _TINY)
    kv = cross(axis, v)
    return v + np.sin(angle) * kv + (1.0 - np.cos(angle)) * cross(axis, kv)


def turn_between(a: Array, b: Array) -> Array:
    """Rotation vector of the smallest rotation from unit vector a to unit vector b, shape (..., 3) [rad].

    For opposite vectors any perpendicular axis will do; the one taken is perpendicular to a's smallest component.
    """
    c = cross(a, b)
    s, along = length(c), dot(a, b)
    angle = np.arctan2(s, along)
    turn = c * (angle / np.maximum(s, _TINY))[..., None]
    opposite = (s < _TINY) & (along < 0.0)
    if opposite.any():
        helper = np.zeros_like(a)
        np.put_along_axis(helper, np.abs(a).argmin(axis=-1, keepdims=True), 1.0, axis=-1)
        turn = np.where(opposite[..., None], np.pi * unit(cross(a, helper)), turn)
    return turn
