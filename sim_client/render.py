"""Pictures of a run, made from its trace after it: rendering takes longer than a tick and would disturb it.

`Stage` shows any tick of a trace from a three-quarter view, with targets, wrists, their trails and a caption.
`render_stereo` is what the robot's eyes see.
"""

from collections.abc import Sequence
from types import TracebackType
from typing import Self

import mujoco
import numpy as np
from PIL import Image as PilImage
from PIL import ImageDraw, ImageFont

from ik_proto.robots import RobotDescription
from sim_client.model import body_pose
from sim_client.offscreen import Image, Offscreen, fixed_camera, free_camera
from sim_client.poses import difference
from sim_client.report import ARMS
from sim_client.robot import SimRobot
from sim_client.trace import Tick
from sim_client.trails import draw_trails

VIEW = (960, 720)
"""Width and height of the view from outside [pixel]."""

EYE = (640, 480)
"""Width and height of one eye's picture [pixel]."""

_EYES = ("left_eye", "right_eye")
_INK, _WARNING, _PAPER = (235, 240, 245), (255, 190, 80), (25, 32, 42)
_AZIMUTH, _ELEVATION = 146.0, -14.0
_ARM_SPAN = 0.35


class Stage:
    """Shows ticks of a trace. Use it in the thread that made it, and close it."""

    def __init__(self, description: RobotDescription) -> None:
        """Build the scene and open the renderer.

        Args:
            description: The robot of the trace.

        Raises:
            NoRendering: This machine cannot render.
        """
        self._robot = SimRobot(description)
        self._offscreen = Offscreen(self._robot.model)
        self._T_world_pelvis = body_pose(self._robot.data, self._robot.model.body(description.base).id)
        self._camera = self._front_camera(description)
        self._font = ImageFont.load_default(20)

    def view(self, ticks: Sequence[Tick], width: int = VIEW[0]) -> Image:
        """The robot from outside, with a caption.

        Args:
            ticks: The ticks so far, oldest first; the last is shown, those before it are its trail.
            width: Width of the picture; narrower than `VIEW` leaves out the sides [pixel].

        Returns:
            Picture of the height of `VIEW`.
        """
        now = ticks[-1]
        self._take_pose(now)
        picture = self._offscreen.image(
            self._robot.data,
            self._camera,
            width,
            VIEW[1],
            draw=lambda scene: draw_trails(scene, ticks, self._T_world_pelvis),
        )
        return self._captioned(picture, now)

    def stereo(self, tick: Tick) -> Image:
        """What the robot's eyes see; see `render_stereo`."""
        self._take_pose(tick)
        return render_stereo(self._offscreen, self._robot.model, self._robot.data)

    @property
    def has_eyes(self) -> bool:
        """Whether the robot's model has the two eye cameras."""
        return has_eyes(self._robot.model)

    def close(self) -> None:
        """Close the renderer."""
        self._offscreen.close()

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self.close()

    def _take_pose(self, tick: Tick) -> None:
        self._robot.data.qpos[:] = tick.qpos
        mujoco.mj_kinematics(self._robot.model, self._robot.data)
        left, right = (
            wrist if target is None else target for wrist, target in zip(tick.wrists, tick.targets, strict=True)
        )
        self._robot.show_targets(left, right)
        mujoco.mj_forward(self._robot.model, self._robot.data)

    def _front_camera(self, description: RobotDescription) -> mujoco.MjvCamera:
        """From the robot's front left, framing head, arms and hips, whatever its size."""
        data = self._robot.data
        shoulders = np.array([data.joint(arm.joints[0]).xanchor for arm in description.arms])
        centre = shoulders.mean(axis=0)
        size = 0.5 * float(np.linalg.norm(centre - self._T_world_pelvis[:3, 3])) + _ARM_SPAN
        forward = self._T_world_pelvis[:3, 0]
        lookat = centre + size * (0.25 * forward - np.array([0.0, 0.0, 0.2]))
        return free_camera(lookat, 2.5 * size, _AZIMUTH, _ELEVATION)

    def _captioned(self, picture: Image, tick: Tick) -> Image:
        canvas = PilImage.fromarray(picture)
        pen = ImageDraw.Draw(canvas)
        width, height = canvas.size
        pen.rectangle((0, height - 40, width, height), fill=_PAPER)
        state, ink = ("holding", _WARNING) if tick.holding else ("following", _INK)
        pen.text((16, height - 33), f"{tick.sim_time:5.1f} s   {state}", font=self._font, fill=ink)
        pairs = zip(ARMS, tick.wrists, tick.targets, strict=True)
        errors = [
            f"{arm} {1e3 * difference(wrist, target)[0]:.0f} mm" for arm, wrist, target in pairs if target is not None
        ]
        if errors:
            text = "   ".join(errors) + " off target"
            pen.text((width - 16, height - 33), text, font=self._font, fill=_INK, anchor="ra")
        return np.asarray(canvas)


def has_eyes(model: mujoco.MjModel) -> bool:
    """Whether a model has the cameras `left_eye` and `right_eye`."""
    return all(fixed_camera(model, name) is not None for name in _EYES)


def render_stereo(offscreen: Offscreen, model: mujoco.MjModel, data: mujoco.MjData) -> Image:
    """Render what both eye cameras see.

    Args:
        offscreen: Renderer of this model.
        model: A model with the cameras `left_eye` and `right_eye`.
        data: State whose kinematics and camera poses are up to date (`mj_forward`, or `mj_step` before it).

    Returns:
        Left picture beside right picture, shape (480, 1280, 3).

    Raises:
        ValueError: The model has no such cameras.
    """
    cameras = [fixed_camera(model, name) for name in _EYES]
    pictures = [offscreen.image(data, camera, *EYE) for camera in cameras if camera is not None]
    if len(pictures) != len(_EYES):
        raise ValueError("the robot's model has no cameras left_eye and right_eye")
    return np.hstack(pictures)
