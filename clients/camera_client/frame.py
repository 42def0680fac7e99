"""One look of a camera: colour, depth where it measures any, and how pixels and rays belong together.

The optical frame has x right, y down and z forward, as everywhere in vision. Depth is measured along z. The picture is
never mirrored: the person's left hand is on its right side.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ik_proto import Array


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A pinhole camera without distortion. Pixel (0, 0) is the centre of the first pixel.

    Attributes:
        fx: Focal length along a row [pixel].
        fy: Focal length along a column [pixel].
        cx: Where the optical axis meets the picture, along a row [pixel].
        cy: The same along a column [pixel].
    """

    fx: float
    fy: float
    cx: float
    cy: float

    def rays(self, pixels: Array) -> Array:
        """Viewing rays with z = 1, shape (..., 3), through pixels (column, row), shape (..., 2)."""
        rays = np.ones((*pixels.shape[:-1], 3))
        rays[..., 0] = (pixels[..., 0] - self.cx) / self.fx
        rays[..., 1] = (pixels[..., 1] - self.cy) / self.fy
        return rays

    def project(self, points: Array) -> Array:
        """Pixels (column, row), shape (..., 2), of points before the camera, optical frame, shape (..., 3) [m]."""
        pixels = np.empty((*points.shape[:-1], 2))
        pixels[..., 0] = self.fx * points[..., 0] / points[..., 2] + self.cx
        pixels[..., 1] = self.fy * points[..., 1] / points[..., 2] + self.cy
        return pixels


@dataclass(frozen=True, slots=True, eq=False)
class RgbdFrame:
    """Colour and depth of one moment, seen from the same place.

    Attributes:
        t_capture: When the light fell in [s], by a clock that never jumps and is the same for all frames.
        depth: Distance along the optical axis, shape (height, width), 16-bit [mm]; 0 where the camera does not know;
            None of a camera that measures none.
        intrinsics: Of this size of picture.
        colour: Red, green, blue, shape (height, width, 3), 8-bit; None where only depth is at hand.
    """

    t_capture: float
    depth: NDArray[np.uint16] | None
    intrinsics: Intrinsics
    colour: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        """Refuse a frame of nothing.

        Raises:
            ValueError: Neither depth nor colour, or of different sizes.
        """
        if self.depth is None and self.colour is None:
            raise ValueError("a frame needs depth or colour")
        if self.depth is not None and self.colour is not None and self.depth.shape != self.colour.shape[:2]:
            raise ValueError(f"depth of {self.depth.shape} does not belong to colour of {self.colour.shape[:2]}")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture [pixel]."""
        picture = self.colour if self.depth is None else self.depth
        assert picture is not None
        return picture.shape[1], picture.shape[0]
