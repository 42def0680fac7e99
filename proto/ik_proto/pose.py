"""Rigid transforms from the wire: accepted only as such, then made exact.

A 4x4 is a pose when its last row is (0, 0, 0, 1) and its rotation part has |R^T R - I| <= 1e-3 (Frobenius), det R > 0.
The checks run on Python floats: nine numbers are too few to pay for numpy calls, and every comparison is written so
that NaN fails it.
"""

import math

import numpy as np

from ik_proto.limits import MAX_ABS_POSITION, ROTATION_TOLERANCE
from ik_proto.messages import Array

_EXACT = 1e-12
"""Below this deviation from orthonormality a projection changes nothing a float64 solver could notice."""


def as_pose(T: Array) -> Array:
    """Take a matrix as a pose.

    A rotation part that is not orthonormal to rounding is replaced by the nearest rotation.

    Args:
        T: Candidate, shape (4, 4), float64.

    Returns:
        `T` itself where it is exact already, else a corrected copy.

    Raises:
        ValueError: It is no rigid transform; the message says why.
    """
    (a, b, c, x), (d, e, f, y), (g, h, i, z), last = T.tolist()
    if last != [0.0, 0.0, 0.0, 1.0]:
        raise ValueError("its last row is not 0 0 0 1")
    if not (abs(x) <= MAX_ABS_POSITION and abs(y) <= MAX_ABS_POSITION and abs(z) <= MAX_ABS_POSITION):
        raise ValueError(f"its position is not within {MAX_ABS_POSITION:g} m")
    xx, yy, zz = a * a + d * d + g * g - 1.0, b * b + e * e + h * h - 1.0, c * c + f * f + i * i - 1.0
    xy, xz, yz = a * b + d * e + g * h, a * c + d * f + g * i, b * c + e * f + h * i
    frobenius = math.sqrt(xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz))
    if not frobenius <= ROTATION_TOLERANCE:
        raise ValueError("its 3x3 part is not a rotation (R^T R differs from I)")
    if not a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0:
        raise ValueError("its 3x3 part is a reflection (det R < 0)")
    return T if frobenius <= _EXACT else _project(T)


def _project(T: Array) -> Array:
    """Replace the rotation part by the nearest rotation.

    Newton-Schulz iteration for the orthogonal polar factor (Higham, Functions of Matrices, 2008, eq. 8.20):
    R <- R (3 I - R^T R) / 2. It converges quadratically, so a deviation of 1e-3 is at rounding after three steps.
    """
    R = T[:3, :3]
    for _ in range(3):
        R = 0.5 * R @ (3.0 * np.eye(3) - R.T @ R)
    exact = T.copy()
    exact[:3, :3] = R
    return exact
