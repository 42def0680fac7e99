"""Depth at a few pixels, from the cluster of the surroundings that the joint belongs to.

At the edge of a limb a patch holds foreground and background, and its mean is neither. Depths are sorted, split where
they leave a gap, and the cluster nearest to where the joint is expected counts. All patches are done at once.
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

_SIDE = 2 * RADIUS + 1
_SIZE = _SIDE * _SIDE
_PLACES = np.arange(_SIZE)


@dataclass(frozen=True, slots=True, eq=False)
class PatchDepths:
    """What the patches say.

    Attributes:
        depth: Median of what counts of the cluster, shape (n,) [m]; NaN where there is none.
        sigma: How far it spreads, as a standard deviation, shape (n,) [m].
        share: Share of the patch in the cluster, 0 to 1, shape (n,).
    """

    depth: Array
    sigma: Array
    share: Array


def patch_depths(
    depth: NDArray[np.uint16], pixels: Array, expected: Array, nearest: Array | None = None
) -> PatchDepths:
    """Read depths around pixels.

    Args:
        depth: The depth picture, shape (height, width) [mm]; 0 where unknown.
        pixels: Column and row, shape (n, 2); a patch around NaN or outside the picture has no depth.
        expected: Depth of the surface that is looked for, shape (n,) [m]; NaN takes the largest cluster.
        nearest: Share of each cluster that counts, from its near end, above 0, shape (n,); None for all of it.

    Returns:
        Depth, spread and share of the clusters.
    """
    values = _sorted_patches(depth, pixels)
    # A cluster begins after a gap; the zeros of what is unknown come first and are one of their own.
    begins = np.ones(values.shape, dtype=bool)
    begins[:, 1:] = values[:, 1:] - values[:, :-1] > GAP
    first = np.flatnonzero(begins)
    size = np.concatenate([first[1:], [values.size]]) - first
    row, column = np.divmod(first, _SIZE)
    median = values.ravel()[first + (size - 1) // 2]
    badness = np.abs(median - expected[row])
    badness = np.where(np.isnan(badness), -size, badness)
    badness[(median == 0.0) | (size < _LEAST_SHARE * _SIZE)] = np.inf
    # Clusters row by row, the best of each first.
    best = np.lexsort((badness, row))[column == 0]
    found = badness[best] < np.inf
    first, begin, size = first[best], column[best, None], size[best]
    share = np.where(found, size / _SIZE, 0.0)
    if nearest is not None:
        size = np.ceil(nearest * size).astype(np.intp)
    median = values.ravel()[first + (size - 1) // 2]
    spread = np.abs(values - median[:, None])
    spread[(begin > _PLACES) | (begin + size[:, None] <= _PLACES)] = np.inf
    spread.sort(axis=1)
    # 1.48 times the median distance from the median is the standard deviation of a normal distribution.
    mad = spread[np.arange(len(best)), (size - 1) // 2]
    return PatchDepths(
        depth=np.where(found, median, np.nan),
        sigma=np.where(found, np.maximum(1.48 * mad, _LEAST_SIGMA), np.inf),
        share=share,
    )


def _sorted_patches(depth: NDArray[np.uint16], pixels: Array) -> Array:
    """The depths of the patches, sorted, shape (n, 81) [m], with 0 for what is unknown, too near or outside."""
    height, width = depth.shape
    patches = np.zeros((len(pixels), _SIDE, _SIDE), np.uint16)
    for patch, (x, y) in zip(patches, pixels.tolist(), strict=True):
        # A NaN compares as false.
        if -0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5:
            column, row = round(x), round(y)
            part = depth[max(row - RADIUS, 0) : row + RADIUS + 1, max(column - RADIUS, 0) : column + RADIUS + 1]
            patch[: part.shape[0], : part.shape[1]] = part
    patches[patches < _NEAREST] = 0
    return np.sort(patches.reshape(-1, _SIZE), axis=1).astype(np.float64) * 1e-3
