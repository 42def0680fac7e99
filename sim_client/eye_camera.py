"""Takes pictures with the robot's two eyes, fast enough for a headset on a machine without a graphics card.

There every pixel is drawn by the processor, twice a picture, so what nobody would miss is left out:

- no smoothing of edges, which draws each pixel four times; no shadows, no reflections, no haze;
- one context and one read-out for both eyes, side by side;
- no sky behind the floor, which would be drawn first and then covered: far walls of its colour stand above the horizon;
- nothing of the robot that neither eye sees, and no marks for wrists and targets, which are no part of the world.
"""

import io

import mujoco
import numpy as np
from PIL import Image as PilImage

from ik_proto import Array
from sim_client.gl import open_context
from sim_client.offscreen import Image, fixed_camera

WIDTH, HEIGHT = 640, 480
"""Size of one eye's picture [pixel]."""

JPEG_QUALITY = 80

_EYES = ("left_eye", "right_eye")
_MARKS_GROUP = 1
_UNSEEN_GROUP = 5
_FLOOR = "scene_floor"
_FLOOR_HALF = 40.0
_FLOOR_GRID = 20.0
_SKY = np.array([0.62, 0.70, 0.78, 1.0], dtype=np.float32)
_GLOW = 0.3
_SIDES = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
_MAX_GEOMS = 2000


class EyeCamera:
    """Both eyes of a robot. Use it in the thread that made it, and close it.

    Attributes:
        fov_deg: Vertical field of view [degree].
    """

    def __init__(self, model: mujoco.MjModel, backend: str) -> None:
        """Open an OpenGL context.

        Args:
            model: A scene of its own, with the cameras `left_eye` and `right_eye`; it is changed.
            backend: "egl", "osmesa" or "glfw".

        Raises:
            Exception: This backend does not work here.
        """
        self._model = model
        self._data = mujoco.MjData(model)
        self._cameras = [camera for name in _EYES if (camera := fixed_camera(model, name))]
        self.fov_deg = float(model.cam_fovy[self._cameras[0].fixedcamid])
        model.vis.quality.offsamples = 0
        model.vis.global_.offwidth, model.vis.global_.offheight = 2 * WIDTH, HEIGHT
        # MuJoCo cuts a floor without end into ten thousand squares.
        model.geom(_FLOOR).size = (_FLOOR_HALF, _FLOOR_HALF, _FLOOR_GRID)
        self._groups = model.geom_group.copy()
        self._context = open_context(backend, 2 * WIDTH, HEIGHT)
        self._context.make_current()
        self._scene = mujoco.MjvScene(model, maxgeom=_MAX_GEOMS)
        for flag in ("SHADOW", "REFLECTION", "SKYBOX", "HAZE", "FOG"):
            self._scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}").value] = 0
        self._options = mujoco.MjvOption()
        self._options.geomgroup[_MARKS_GROUP] = self._options.sitegroup[_MARKS_GROUP] = 0
        self._renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._renderer)
        self._pixels = np.empty((HEIGHT, 2 * WIDTH, 3), dtype=np.uint8)

    def take(self, qpos: Array) -> tuple[bytes, bytes]:
        """Take a picture with each eye.

        Args:
            qpos: Positions of all joints, shape (nq,) [rad].

        Returns:
            Left and right, JPEG.
        """
        picture = self.render(qpos)
        return _jpeg(picture[:, :WIDTH]), _jpeg(picture[:, WIDTH:])

    def render(self, qpos: Array) -> Image:
        """Draw what both eyes see.

        Args:
            qpos: Positions of all joints, shape (nq,) [rad].

        Returns:
            Left beside right, shape (480, 1280, 3); overwritten by the next call.
        """
        model, data = self._model, self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)  # a tracking camera of the model may want it
        mujoco.mj_camlight(model, data)
        self._leave_out_the_unseen()
        for number, camera in enumerate(self._cameras):
            mujoco.mjv_updateScene(
                model, data, self._options, None, camera, mujoco.mjtCatBit.mjCAT_ALL.value, self._scene
            )
            self._add_sky()
            area = mujoco.MjrRect(number * WIDTH, 0, WIDTH, HEIGHT)
            mujoco.mjr_render(area, self._scene, self._renderer)
        mujoco.mjr_readPixels(self._pixels, None, mujoco.MjrRect(0, 0, 2 * WIDTH, HEIGHT), self._renderer)
        return self._pixels[::-1]  # OpenGL's first row is the lowest.

    def close(self) -> None:
        """Free the OpenGL context."""
        self._context.make_current()
        self._renderer.free()
        self._context.free()

    def _leave_out_the_unseen(self) -> None:
        """Put geoms whose bounding spheres lie outside of both eyes' views into a group that is not drawn."""
        seen = np.zeros(self._model.ngeom, dtype=bool)
        tangent = np.tan(np.radians(0.5 * self.fov_deg)) * np.array([WIDTH / HEIGHT, 1.0])
        slant = np.sqrt(1.0 + tangent**2)
        radius = self._model.geom_rbound
        for camera in self._cameras:
            at, R = self._data.cam_xpos[camera.fixedcamid], self._data.cam_xmat[camera.fixedcamid].reshape(3, 3)
            place = (self._data.geom_xpos - at) @ R  # x right, y up, looking along -z
            # Distance outside of the left or right, and of the upper or lower side of the view.
            outside = (np.abs(place[:, :2]) + place[:, 2:] * tangent) / slant
            seen |= (outside < radius[:, None]).all(axis=1)
        seen |= radius <= 0.0  # a plane has no bound
        self._model.geom_group[:] = np.where(seen, self._groups, _UNSEEN_GROUP)

    def _add_sky(self) -> None:
        half = 0.5 * _FLOOR_HALF
        for x, y in _SIDES:
            geom = self._scene.geoms[self._scene.ngeom]
            size = np.array([0.1 if x else _FLOOR_HALF, 0.1 if y else _FLOOR_HALF, half])
            place = np.array([x * _FLOOR_HALF, y * _FLOOR_HALF, half])
            mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_BOX.value, size, place, np.eye(3).ravel(), _SKY)
            geom.emission = _GLOW
            self._scene.ngeom += 1


def _jpeg(picture: Image) -> bytes:
    buffer = io.BytesIO()
    PilImage.fromarray(picture).save(buffer, "JPEG", quality=JPEG_QUALITY)
    return buffer.getvalue()
