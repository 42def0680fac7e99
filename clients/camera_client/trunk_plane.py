"""How far the front of the trunk is turned, from the depths between shoulders and hips.

Some hundred pixels say more than four joints, of which an arm may hide one. A plane is fitted to them; what is in front
of it, an arm, does not count. The front of a trunk is round, so the plane turns less than the body, and a body that is
not seen quite in the middle seems a little turned: `torso` knows how much, and the calibration what it is of an
operator who faces the camera.
"""

import math

import numpy as np
from numpy.typing import NDArray

from camera_client.frame import Intrinsics
from camera_client.vectors import middle
from ik_proto import Array

_ACROSS, _DOWN = np.linspace(0.1, 0.9, 11), np.linspace(0.08, 0.95, 12)
"""Where depths are read, from right to left and from the shoulders to the hips."""
_ACROSS, _DOWN = (share.ravel() for share in np.meshgrid(_ACROSS, _DOWN))
_BLEND = np.stack([_ACROSS * (1 - _DOWN), (1 - _ACROSS) * (1 - _DOWN), _ACROSS * _DOWN, (1 - _ACROSS) * _DOWN], axis=1)
"""How much of each corner there is in each of these places, shape (132, 4)."""
_LEAST = 40
"""Depths that a plane needs."""
_BEFORE = 0.06
"""What is further in front of the plane than this is an arm [m]."""
_SCALES = (0.15, 0.06, 0.04)
"""Where a depth counts half, from one iteration to the next [m]."""
_RIDGE = 1e-9 * np.eye(3)
"""Keeps the fit regular where nothing counts."""
_NEAREST = 300
"""Depths below this are no measurement [mm]."""


def trunk_turn(depth: NDArray[np.uint16], corners: Array, intrinsics: Intrinsics) -> float:
    """Angle about the picture's vertical by which the front of the trunk is turned to its left [rad].

    Args:
        depth: The depth picture, shape (height, width) [mm]; 0 where unknown.
        corners: Pixels of left shoulder, right shoulder, left hip and right hip, shape (4, 2); NaN where not seen.
        intrinsics: Of the picture.

    Returns:
        The angle; NaN where there is too little to tell it from.
    """
    if not np.isfinite(corners).all():
        return math.nan
    height, width = depth.shape
    pixels = np.rint(_BLEND @ corners)
    column, row = np.minimum(np.maximum(pixels, 0.0), (width - 1, height - 1)).astype(np.intp).T
    z = depth[row, column]
    valid = np.flatnonzero(z >= _NEAREST)
    if len(valid) < _LEAST:
        return math.nan
    z, column = z[valid] * 1e-3, column[valid]
    centre = middle(z)
    D = np.empty((3, len(z)))
    D[0], D[1], D[2] = 1.0, (column - column.mean()) * (centre / intrinsics.fx), _DOWN[valid] - 0.5
    plane = np.array([centre, 0.0, 0.0])
    for scale in _SCALES:
        off = z - plane @ D
        weight = (off >= -max(_BEFORE, scale)) / (1.0 + (off / scale) ** 2)
        weighted = weight * D
        plane = np.linalg.solve(weighted @ D.T + _RIDGE, weighted @ z)
    return math.atan(plane[1]) if weight.sum() > 0.5 * _LEAST else math.nan
