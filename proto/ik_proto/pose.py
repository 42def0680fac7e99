"""Rigid transforms from the wire: accepted only as such, then made exact.

A 4x4 is a pose when its last row is (0, 0, 0, 1) and its rotation part has |R^T R - I| <= 1e-3 (Frobenius), det R > 0.
One pose is checked on Python floats, because nine numbers are too few to pay for numpy calls; a batch on arrays. Both
evaluate the same expressions in the same order, so a pose comes out the same to the last bit, alone or in a batch.
Every comparison is written so that NaN fails it.
"""

from typing import TypeVar

import numpy as np

from ik_proto.limits import MAX_ABS_POSITION, ROTATION_TOLERANCE
from ik_proto.messages import Array
from ik_proto.rows import require_rows

_F = TypeVar("_F", float, Array)

_ROUGH = ROTATION_TOLERANCE**2
EXACT = 1e-24
"""Squared deviation from orthonormality below which a projection changes nothing a float64 solver could notice."""


class PoseError(ValueError):
    """A matrix that is no rigid transform. Its message is what follows the name of the matrix."""


def as_pose(T: Array) -> Array:
    """Take a matrix as a pose.

    A rotation part that is not orthonormal to rounding is replaced by the nearest rotation.

    Args:
        T: Candidate, shape (4, 4), float64.

    Returns:
        `T` itself where it is exact already, else a corrected copy.

    Raises:
        PoseError: It is no rigid transform.
    """
    return T if deviation(T.tolist()) <= EXACT else projected(T)


def deviation(rows: list[list[float]]) -> float:
    """Check that the rows of a matrix are those of a pose.

    Args:
        rows: Four rows of four numbers.

    Returns:
        How far its rotation part is from orthonormal: |R^T R - I|^2 (Frobenius).

    Raises:
        PoseError: It is no rigid transform.
        TypeError, ValueError, OverflowError: They are not four rows of four numbers.
    """
    (a, b, c, x), (d, e, f, y), (g, h, i, z), (zero_x, zero_y, zero_z, one) = rows
    if not (zero_x == zero_y == zero_z == 0.0 and one == 1.0):
        raise PoseError("is not a pose: its last row is not 0 0 0 1")
    if not (abs(x) <= MAX_ABS_POSITION and abs(y) <= MAX_ABS_POSITION and abs(z) <= MAX_ABS_POSITION):
        raise PoseError(f"is not a pose: its position is not within {MAX_ABS_POSITION:g} m")
    squared, determinant = _orthonormality(a, b, c, d, e, f, g, h, i)
    if not squared <= _ROUGH:
        raise PoseError("is not a pose: its 3x3 part is not a rotation (R^T R differs from I)")
    if not determinant > 0.0:
        raise PoseError("is not a pose: its 3x3 part is a reflection (det R < 0)")
    return squared


def as_poses(T: Array) -> Array:
    """Take matrices as poses, all at once.

    Args:
        T: Candidates, shape (N, 4, 4), float64.

    Returns:
        `T` itself where all are exact already, else a copy with the others corrected: each as by `as_pose`.

    Raises:
        RowError: One is no rigid transform; the first such row, and why.
    """
    (a, b, c, x), (d, e, f, y), (g, h, i, z), last = np.ascontiguousarray(T.transpose(1, 2, 0))
    with np.errstate(over="ignore", invalid="ignore"):
        squared, determinant = _orthonormality(a, b, c, d, e, f, g, h, i)
        near = (abs(x) <= MAX_ABS_POSITION) & (abs(y) <= MAX_ABS_POSITION) & (abs(z) <= MAX_ABS_POSITION)
        good = (last.T == (0.0, 0.0, 0.0, 1.0)).all(axis=1) & near & (squared <= _ROUGH) & (determinant > 0.0)
    require_rows(good, T, as_pose)
    inexact = squared > EXACT
    if not inexact.any():
        return T
    exact = T.copy()
    exact[inexact] = projected(T[inexact])
    return exact


def _orthonormality(a: _F, b: _F, c: _F, d: _F, e: _F, f: _F, g: _F, h: _F, i: _F) -> tuple[_F, _F]:
    """|R^T R - I|^2 (Frobenius) and det R of the matrix with rows abc, def, ghi: of floats, or of arrays of them."""
    xx, yy, zz = a * a + d * d + g * g - 1.0, b * b + e * e + h * h - 1.0, c * c + f * f + i * i - 1.0
    xy, xz, yz = a * b + d * e + g * h, a * c + d * f + g * i, b * c + e * f + h * i
    squared = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)
    return squared, a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def projected(T: Array) -> Array:
    """Replace the rotation part of a nearly rigid transform, shape (4, 4), or of many, by the nearest rotation.

    Newton-Schulz iteration for the orthogonal polar factor (Higham, Functions of Matrices, 2008, eq. 8.20):
    R <- R (3 I - R^T R) / 2. It converges quadratically, so a deviation of 1e-3 is at rounding after three steps.
    """
    R = T[..., :3, :3]
    for _ in range(3):
        R = 0.5 * R @ (3.0 * np.eye(3) - R.swapaxes(-1, -2) @ R)
    exact = T.copy()
    exact[..., :3, :3] = R
    return exact
