"""Renders colour and depth of a skinned person before a camera, off screen in MuJoCo, with exact joints.

The world has the axes of the robot's pelvis; the person stands at its origin and faces +x, where the camera is.
"""

import struct
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from skinned_person import Array, Person

from camera_client.frame import Intrinsics
from sim_client.gl import find_backend, open_context

WIDTH, HEIGHT = 640, 360
INTRINSICS = Intrinsics(515.0, 515.0, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
"""Of an OAK-D Lite's colour camera at this size, about."""
_NEAR, _FAR = 0.05, 12.0


class RenderedPerson:
    """A person in a room with some furniture. Use it in the thread that made it, and close it.

    Attributes:
        person: Who is seen.
    """

    def __init__(
        self, person: Person, texture: Path, camera: tuple[float, float, float] = (2.9, 0.1, 1.15), pitch: float = 0.0
    ) -> None:
        """Open an OpenGL context.

        Args:
            person: Who is seen.
            texture: PNG file with the person's skin and clothes.
            camera: Where the camera is [m].
            pitch: How far it looks down [rad].

        Raises:
            sim_client.gl.NoRendering: This machine cannot render.
        """
        self.person = person
        forward = np.array([-np.cos(pitch), 0.0, -np.sin(pitch)])
        right = np.array([0.0, 1.0, 0.0])
        self._eye = np.array(camera)
        self._R_world_optical = np.stack([right, np.cross(forward, right), forward], axis=1)
        self._model = mujoco.MjModel.from_xml_string(
            self._xml(), assets={"person.skn": _skin(person), "person.png": texture.read_bytes()}
        )
        self._data = mujoco.MjData(self._model)
        self._context: Any = open_context(find_backend(), WIDTH, HEIGHT)
        self._context.make_current()
        self._scene = mujoco.MjvScene(self._model, maxgeom=1000)
        self._renderer = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._renderer)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW.value] = False
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED.value
        self._camera.fixedcamid = 0

    def render(self, R: Array, p: Array) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """A picture of the person with these bones (`Person.pose`).

        Returns:
            Colour, shape (height, width, 3), red, green, blue; depth along the optical axis, shape (height, width) [m].
        """
        for i, (R_bone, p_bone) in enumerate(zip(R, p, strict=True)):
            self._data.mocap_pos[i] = p_bone
            mujoco.mju_mat2Quat(self._data.mocap_quat[i], R_bone.ravel())
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        self._context.make_current()
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self._data, mujoco.MjvOption(), None, self._camera, everything, self._scene)
        area = mujoco.MjrRect(0, 0, WIDTH, HEIGHT)
        colour = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        buffer = np.empty((HEIGHT, WIDTH), np.float32)
        mujoco.mjr_render(area, self._scene, self._renderer)
        mujoco.mjr_readPixels(colour, buffer, area, self._renderer)
        near, far = (bound * self._model.stat.extent for bound in (_NEAR, _FAR))
        depth = near / (1.0 - buffer * (1.0 - near / far))
        return colour[::-1], depth[::-1]

    def in_camera(self, points: Array) -> Array:
        """World points in the camera's optical frame (x right, y down, z forward) [m]."""
        return (points - self._eye) @ self._R_world_optical

    def close(self) -> None:
        """Free the OpenGL context."""
        self._context.make_current()
        self._renderer.free()
        self._context.free()

    def _xml(self) -> str:
        # MuJoCo's cameras have x right, y up, z backward.
        axes = self._R_world_optical[:, 0], -self._R_world_optical[:, 1]
        fovy = np.degrees(2.0 * np.arctan(HEIGHT / 2 / INTRINSICS.fy))
        bones = "".join(
            f'<body name="{name}" mocap="true" pos="{_numbers(head)}">'
            '<geom type="sphere" size="0.001" rgba="0 0 0 0" contype="0" conaffinity="0"/></body>'
            for name, head in zip(self.person.names, self.person.heads, strict=True)
        )
        return f"""
        <mujoco>
          <visual>
            <global offwidth="{WIDTH}" offheight="{HEIGHT}"/>
            <quality offsamples="0"/>
            <map znear="{_NEAR}" zfar="{_FAR}"/>
            <headlight ambient=".4 .4 .4" diffuse=".4 .4 .4" specular="0 0 0"/>
          </visual>
          <statistic extent="1"/>
          <asset>
            <texture name="person" type="2d" file="person.png"/>
            <material name="person" texture="person" specular=".1" shininess=".1"/>
          </asset>
          <deformable><skin name="person" file="person.skn" material="person"/></deformable>
          <worldbody>
            <light pos="2.5 0.8 2.6" dir="-.8 -.2 -.6" diffuse=".5 .5 .5" specular="0 0 0" castshadow="false"/>
            <geom type="plane" size="6 6 .1" rgba=".55 .5 .45 1"/>
            <geom type="box" pos="-1.6 0 1.5" size=".05 5 1.5" rgba=".76 .75 .73 1"/>
            <geom type="box" pos="-1.1 -1.3 .4" size=".25 .35 .4" rgba=".5 .35 .2 1"/>
            <geom type="box" pos="-1.0 1.4 .9" size=".2 .3 .9" rgba=".75 .75 .7 1"/>
            <camera name="camera" pos="{_numbers(self._eye)}" xyaxes="{_numbers(np.concatenate(axes))}" fovy="{fovy}"/>
            {bones}
          </worldbody>
        </mujoco>"""


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _skin(person: Person) -> bytes:
    """The person in MuJoCo's SKN format."""
    parts = [
        struct.pack("<4i", len(person.vertices), len(person.vertices), len(person.faces), len(person.names)),
        person.vertices.astype("<f4").tobytes(),
        np.stack([person.uv[:, 0], 1.0 - person.uv[:, 1]], axis=1).astype("<f4").tobytes(),
        person.faces.astype("<i4").tobytes(),
    ]
    for k, name in enumerate(person.names):
        (touched,) = np.nonzero(person.weights[:, k] > 1e-4)
        parts += [
            name.encode().ljust(40, b"\0"),
            person.heads[k].astype("<f4").tobytes(),
            np.array([1, 0, 0, 0], "<f4").tobytes(),
            struct.pack("<i", len(touched)),
            touched.astype("<i4").tobytes(),
            person.weights[touched, k].astype("<f4").tobytes(),
        ]
    return b"".join(parts)
