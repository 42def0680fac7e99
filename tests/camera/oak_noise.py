"""What stereo matching makes of true depth: the noise of an OAK-D Lite, about.

Depth is focal length times baseline over disparity, so its error grows with its square. The disparity has correlated
noise and is a multiple of 1/32 pixel; at edges it belongs to a pixel somewhere near and is smoothed by a median, which
fattens limbs and leaves flying pixels; beside an edge, where only one of the two cameras sees the background, it is
unknown, and so it is here and there. Scales are those of a recording of the real camera.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

FOCAL_BASELINE = 33.0
"""Focal length times baseline [pixel m]."""
FOCAL = 515.0
"""Focal length of the colour camera that depth is aligned to [pixel]."""

_JITTER = 1.6
"""By how much edges are displaced, as a standard deviation [pixel]."""
_QUANTUM = 1.0 / 32.0
_DROPPED = 0.004
_FIELD = (512, 1024)


class OakNoise:
    """Noise of one camera, drawn from a generator."""

    def __init__(self, rng: np.random.Generator, sigma: float = 0.10) -> None:
        """Prepare.

        Args:
            rng: Where chance comes from.
            sigma: Standard deviation of the disparity [pixel].
        """
        self._rng = rng
        # Fields of correlated noise are drawn once; every frame takes other windows of them.
        self._noise = sigma * _smooth(rng.standard_normal(_FIELD), 2.0)
        self._edges = _JITTER * _smooth(rng.standard_normal(_FIELD), 3.0)

    def __call__(self, depth: NDArray[np.float32], box: tuple[int, int, int, int]) -> NDArray[np.uint16]:
        """Measure a true depth picture.

        Args:
            depth: Shape (height, width) [m].
            box: First and last row and column that matter; depth is unknown outside.

        Returns:
            Shape (height, width) [mm].
        """
        top, bottom, left, right = box
        disparity = FOCAL_BASELINE / np.maximum(depth[top:bottom, left:right], 0.2)
        h, w = disparity.shape
        rows, columns = np.mgrid[0:h, 0:w]
        rows = (rows + np.rint(self._window(self._edges, h, w)).astype(int)).clip(0, h - 1)
        columns = (columns + np.rint(self._window(self._edges, h, w)).astype(int)).clip(0, w - 1)
        windows = sliding_window_view(np.pad(disparity[rows, columns], 2, mode="edge"), (5, 5))
        disparity = np.partition(windows.reshape(h, w, 25), 12, axis=2)[:, :, 12]
        noisy = np.rint((disparity + self._window(self._noise, h, w)) / _QUANTUM) * _QUANTUM
        unknown = self._rng.random((h, w)) < _DROPPED
        edge = np.zeros((h, w))
        edge[:, 1:] = np.diff(disparity, axis=1)
        # The band that one camera does not see is as wide as the step in disparity, in pixels of the colour camera.
        width = np.where(edge > 1.0, edge * FOCAL * 0.075 / FOCAL_BASELINE, 0.0)
        for step in range(1, 6):
            unknown[:, :-step] |= width[:, step:] >= step
        out = np.zeros(depth.shape, np.uint16)
        out[top:bottom, left:right] = np.where(unknown, 0.0, 1000.0 * FOCAL_BASELINE / noisy)
        return out

    def _window(self, field: NDArray[np.float64], h: int, w: int) -> NDArray[np.float64]:
        top, left = self._rng.integers(0, field.shape[0] - h), self._rng.integers(0, field.shape[1] - w)
        return field[top : top + h, left : left + w]


def _smooth(field: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """A Gaussian blur with unit variance afterwards; it wraps around."""
    fy, fx = np.fft.fftfreq(field.shape[0])[:, None], np.fft.rfftfreq(field.shape[1])
    blur = np.exp(-2.0 * (np.pi * sigma) ** 2 * (fy * fy + fx * fx))
    out = np.fft.irfft2(np.fft.rfft2(field) * blur, s=field.shape)
    return out / out.std()
