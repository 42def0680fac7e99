"""Rotations as matrices and as vectors: axis times angle [rad].

Both directions hold at every angle, the half turn included; there the vector's sign is free.
"""

import math

import numpy as np

from ik_proto import Array


def rotation_vector(R: Array) -> Array:
    """The axis of a rotation times its angle, the logarithm on SO(3).

    Goes through the unit quaternion, read from its largest component, so that no angle divides by a small number
    (Shepperd, Quaternion from Rotation Matrix, J. Guidance and Control 1(3), 1978).

    Args:
        R: Rotation, shape (3, 3).

    Returns:
        Vector of norm 0 to pi, shape (3,) [rad].
    """
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    # Row k is the quaternion (w, x, y, z) times four times its component k.
    rows = (
        (1.0 + a + e + i, h - f, c - g, d - b),
        (h - f, 1.0 + a - e - i, b + d, c + g),
        (c - g, b + d, 1.0 - a + e - i, f + h),
        (d - b, c + g, f + h, 1.0 - a - e + i),
    )
    w, x, y, z = max(rows, key=lambda row: math.hypot(*row))
    sine = math.hypot(x, y, z)
    if sine == 0.0:
        return np.zeros(3)
    angle = 2.0 * math.atan2(sine, abs(w))
    return np.array([x, y, z]) * (math.copysign(angle, w) / sine)


def rotation_matrix(vector: Array) -> Array:
    """The rotation about an axis by an angle, the exponential on SO(3): Rodrigues' formula.

    Args:
        vector: Axis times angle, shape (3,) [rad].

    Returns:
        Rotation, shape (3, 3).
    """
    angle = math.hypot(*vector.tolist())
    x, y, z = vector.tolist()
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # sin(a)/a and (1 - cos(a))/a^2, both written with numpy's sinc, which is exact at zero.
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.eye(3) + first * K + second * (K @ K)


def turn(R_from: Array, R_to: Array) -> float:
    """The angle between two rotations, 0 to pi [rad].

    Args:
        R_from: Rotation, shape (3, 3).
        R_to: Rotation, shape (3, 3).
    """
    return math.hypot(*rotation_vector(R_to @ R_from.T).tolist())
