"""Depth at a few pixels, from the cluster of the surroundings that the joint belongs to.

At the edge of a limb a patch holds foreground and background, and its mean is neither. Depths are sorted, split where
they leave a gap, and the cluster nearest to where the joint is expected counts. All pixels are done at once.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ik_proto import Array

RADIUS = 4
"""A patch has 9 x 9 pixels."""
GAP = 0.08
"""Depths further apart than this belong to different surfaces [m]."""

_LEAST_SHARE = 0.12
"""Share of a patch below which a cluster is noise."""
_LEAST_SIGMA = 0.012
"""No patch is better than this [m]: what is left when the noise of single pixels has averaged out."""
_NEAREST = 300
"""Depths below this are no measurement [mm]."""

_OFFSETS = np.stack(np.meshgrid(np.arange(-RADIUS, RADIUS + 1), np.arange(-RADIUS, RADIUS + 1)), axis=-1).reshape(-1, 2)
_SIZE = len(_OFFSETS)
_PLACES = np.arange(_SIZE)


@dataclass(frozen=True, slots=True, eq=False)
class PatchDepths:
    """What the patches say.

    Attributes:
        depth: Median of the cluster, shape (n,) [m]; NaN where there is none.
        sigma: How far its members spread, as a standard deviation, shape (n,) [m].
        share: Share of the patch in the cluster, 0 to 1, shape (n,).
    """

    depth: Array
    sigma: Array
    share: Array


def patch_depths(depth: NDArray[np.uint16], pixels: Array, expected: Array) -> PatchDepths:
    """Read depths around pixels.

    Args:
        depth: The depth picture, shape (height, width) [mm]; 0 where unknown.
        pixels: Column and row, shape (n, 2); a patch around NaN or outside the picture has no depth.
        expected: Depth of the surface that is looked for, shape (n,) [m]; NaN takes the largest cluster.

    Returns:
        Depth, spread and share of the clusters.
    """
    values = np.sort(_gather(depth, pixels), axis=1)
    valid = values > 0.0
    # A cluster ends before a gap; the invalid zeros come first and are cut off by the gap to the first valid depth.
    starts = np.ones(values.shape, dtype=bool)
    starts[:, 1:] = np.diff(values, axis=1) > GAP
    first = np.maximum.accumulate(np.where(starts, _PLACES, 0), axis=1)
    ends = np.ones_like(starts)
    ends[:, :-1] = starts[:, 1:]
    last = np.minimum.accumulate(np.where(ends, _PLACES, _SIZE - 1)[:, ::-1], axis=1)[:, ::-1]
    size = last - first + 1
    rows = np.arange(len(values))
    middle = np.take_along_axis(values, (first + last) // 2, axis=1)
    known = np.isfinite(expected)
    badness = np.where(known[:, None], np.abs(middle - np.where(known, expected, 0.0)[:, None]), -size)
    badness = np.where(valid & (size >= _LEAST_SHARE * _SIZE), badness, np.inf)
    best = badness.argmin(axis=1)
    found = badness[rows, best] < np.inf
    median = middle[rows, best]
    first, last, size = first[rows, best], last[rows, best], size[rows, best]
    spread = np.abs(values - median[:, None])
    spread[(first[:, None] > _PLACES) | (last[:, None] < _PLACES)] = np.inf
    # 1.48 times the median distance from the median is the standard deviation of a normal distribution.
    mad = np.sort(spread, axis=1)[rows, (size - 1) // 2]
    return PatchDepths(
        depth=np.where(found, median, np.nan),
        sigma=np.where(found, np.maximum(1.48 * mad, _LEAST_SIGMA), np.inf),
        share=np.where(found, size / _SIZE, 0.0),
    )


def _gather(depth: NDArray[np.uint16], pixels: Array) -> Array:
    """The patches, shape (n, 81) [m], with 0 for what is unknown, too near or outside the picture."""
    height, width = depth.shape
    inside = (pixels >= -0.5) & (pixels < (width - 0.5, height - 0.5))
    inside = np.asarray(inside.all(axis=1))
    centre = np.rint(np.where(inside[:, None], pixels, 0.0)).astype(np.intp)
    at = centre[:, None, :] + _OFFSETS
    column, row = at[..., 0], at[..., 1]
    usable = inside[:, None] & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    values = depth[row.clip(0, height - 1), column.clip(0, width - 1)]
    return np.where(usable & (values >= _NEAREST), values * 1e-3, 0.0)
