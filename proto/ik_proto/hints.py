"""Elbow wishes and weights from the wire: accepted only in their ranges, and directions made unit vectors.

As for poses, one is checked on Python floats and a batch on arrays, by the same expressions in the same order.
"""

import math

import numpy as np

from ik_proto.limits import MIN_ELBOW_LENGTH
from ik_proto.messages import Array
from ik_proto.rows import require_rows


def as_elbow(elbow: Array) -> Array:
    """Take four numbers as a direction from shoulder to elbow and the confidence in it.

    Args:
        elbow: x, y, z of any length, and confidence, shape (4,), finite.

    Returns:
        A unit vector and the confidence, shape (4,). Without confidence a vector too short to have a direction is
        allowed, and comes out as zero.

    Raises:
        ValueError: The confidence is out of range, or there is confidence in no direction; the message says why.
    """
    x, y, z, confidence = elbow.tolist()
    if not 0.0 <= confidence <= 1.0:
        raise ValueError(f"has confidence {confidence:g}, not one from 0 to 1")
    length = math.sqrt(x * x + y * y + z * z)
    if length > MIN_ELBOW_LENGTH:
        return np.array([x / length, y / length, z / length, confidence])
    if confidence > 0.0:
        raise ValueError(f"points nowhere: its direction is no longer than {MIN_ELBOW_LENGTH:g}")
    return np.zeros(4)


def as_elbows(elbows: Array) -> Array:
    """Take rows of four numbers as elbow directions with confidence, all at once.

    Args:
        elbows: Shape (N, 4), finite.

    Returns:
        Each as by `as_elbow`, shape (N, 4).

    Raises:
        RowError: One of them is none; the first such row, and why.
    """
    x, y, z, confidence = elbows.T
    length = np.sqrt(x * x + y * y + z * z)
    pointing = length > MIN_ELBOW_LENGTH
    good = (confidence >= 0.0) & (confidence <= 1.0) & (pointing | (confidence == 0.0))
    require_rows(good, elbows, as_elbow)
    unit = np.zeros(elbows.shape)
    unit[pointing, :3] = elbows[pointing, :3] / length[pointing, None]
    unit[:, 3] = confidence
    return unit


def as_weights(weights: Array) -> Array:
    """Take a 2x2 as factors on the weights of left position, left rotation, right position and right rotation.

    Args:
        weights: Shape (2, 2), finite.

    Returns:
        `weights` itself.

    Raises:
        ValueError: One is out of range.
    """
    if not all(0.0 <= weight <= 1.0 for row in weights.tolist() for weight in row):
        raise ValueError("must hold factors from 0 to 1")
    return weights


def as_weight_rows(weights: Array) -> Array:
    """Take 2x2 matrices as factors on weights, all at once.

    Args:
        weights: Shape (N, 2, 2), finite.

    Returns:
        `weights` itself.

    Raises:
        RowError: One is out of range; the first such row, and why.
    """
    good = np.logical_and.reduce((weights >= 0.0) & (weights <= 1.0), axis=(1, 2))
    require_rows(good, weights, as_weights)
    return weights
