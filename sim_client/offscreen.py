"""Pictures of a scene, rendered off screen."""

from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_client.gl import find_backend, open_context

Image = NDArray[np.uint8]
"""Shape (height, width, 3), red, green, blue, first row at the top."""

Draw = Callable[[mujoco.MjvScene], None]
"""Adds decoration to a scene that is about to be rendered."""

_MAX_GEOMS = 10_000


class Offscreen:
    """Renders a model. Use it in the thread that made it, and close it."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Open an OpenGL context.

        Args:
            model: Its off-screen buffer size (`vis.global_`) bounds the pictures.

        Raises:
            NoRendering: This machine cannot.
        """
        self._model = model
        buffer = model.vis.global_
        self._context: Any = open_context(find_backend(), buffer.offwidth, buffer.offheight)
        self._context.make_current()
        self._scene = mujoco.MjvScene(model, maxgeom=_MAX_GEOMS)
        self._renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._renderer)

    def image(
        self,
        data: mujoco.MjData,
        camera: mujoco.MjvCamera,
        width: int,
        height: int,
        *,
        options: mujoco.MjvOption | None = None,
        draw: Draw | None = None,
    ) -> Image:
        """Render one picture.

        Args:
            data: State whose kinematics are up to date.
            camera: From where.
            width: Width [pixel].
            height: Height [pixel].
            options: What to show; None shows the default groups.
            draw: Adds decoration.

        Returns:
            The picture.
        """
        self._context.make_current()
        mujoco.mjv_updateScene(
            self._model,
            data,
            options or mujoco.MjvOption(),
            None,
            camera,
            mujoco.mjtCatBit.mjCAT_ALL.value,
            self._scene,
        )
        if draw:
            draw(self._scene)
        area = mujoco.MjrRect(0, 0, width, height)
        pixels = np.empty((height, width, 3), dtype=np.uint8)
        mujoco.mjr_render(area, self._scene, self._renderer)
        mujoco.mjr_readPixels(pixels, None, area, self._renderer)
        return pixels[::-1]  # OpenGL's first row is the lowest.

    def close(self) -> None:
        """Free the OpenGL context."""
        if self._context is not None:
            self._context.make_current()
            self._renderer.free()
            self._context.free()
            self._context = None

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self.close()


def fixed_camera(model: mujoco.MjModel, name: str) -> mujoco.MjvCamera | None:
    """A camera of the model by name; None if it has no such camera."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA.value, name)
    if number < 0:
        return None
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FIXED.value
    camera.fixedcamid = number
    return camera


def free_camera(lookat: NDArray[np.float64], distance: float, azimuth: float, elevation: float) -> mujoco.MjvCamera:
    """A camera that looks at a point [m] from a distance [m]; angles in degrees, azimuth about z, elevation up."""
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE.value
    camera.lookat[:] = lookat
    camera.distance, camera.azimuth, camera.elevation = distance, azimuth, elevation
    return camera
