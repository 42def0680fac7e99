"""Small vector algebra on arrays of shape (..., 3), without the overhead of numpy's general routines."""

import math

import numpy as np

from ik_proto import Array

_TINY = 1e-9


def cross(a: Array, b: Array) -> Array:
    """Cross products, shape (..., 3)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out[..., 0] = ay * bz - az * by
    out[..., 1] = az * bx - ax * bz
    out[..., 2] = ax * by - ay * bx
    return out


def dot(a: Array, b: Array) -> Array:
    """Dot products, shape (...)."""
    return (a * b).sum(axis=-1)


def length(a: Array) -> Array:
    """Euclidean lengths, shape (...)."""
    return np.sqrt((a * a).sum(axis=-1))


def unit(a: Array) -> Array:
    """Vectors of length 1; one of length 0 stays."""
    return a / np.maximum(length(a), _TINY)[..., None]


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
    s = length(c)
    helper = np.zeros_like(a)
    np.put_along_axis(helper, np.abs(a).argmin(axis=-1, keepdims=True), 1.0, axis=-1)
    axis = np.where((s < _TINY)[..., None], unit(cross(a, helper)), c / np.maximum(s, _TINY)[..., None])
    return axis * np.arctan2(s, dot(a, b))[..., None]
