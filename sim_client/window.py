"""The window: MuJoCo's viewer, with trails, and targets that can be dragged.

In the window a double click selects a target, Ctrl and the right mouse button move it, Ctrl and the left one turn it.
"""

import os
import subprocess
import sys
import threading

import mujoco
import mujoco.viewer

from sim_client.model import body_pose
from sim_client.robot import SimRobot
from sim_client.trace import Tick, Trace
from sim_client.trails import draw_trails

TICKS_PER_FRAME = 2
"""Control ticks from one picture to the next."""

_TRAIL_TICKS = 60
_TRIAL = "import glfw, sys; sys.exit(0 if glfw.init() else 1)"
_TRIAL_LIMIT = 20.0
_CLOSE_LIMIT = 5.0


def display_fault() -> str | None:
    """Why no window can be opened, in one line; None if one can.

    Tried in a process of its own: the viewer waits for ever for a window that cannot be opened.
    """
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "no display, so no window (DISPLAY is not set)"
    try:
        trial = subprocess.run([sys.executable, "-P", "-c", _TRIAL], capture_output=True, timeout=_TRIAL_LIMIT)
    except (OSError, subprocess.TimeoutExpired):
        return "the display does not answer, so no window"
    return None if trial.returncode == 0 else "the display cannot be opened, so no window"


class Viewer:
    """MuJoCo's viewer, open on a robot.

    Attributes:
        handle: What MuJoCo gives to draw in it.
    """

    def __init__(self, robot: SimRobot) -> None:
        """Open it, looking at the robot from its front left."""
        others = set(threading.enumerate())
        self.handle = mujoco.viewer.launch_passive(robot.model, robot.data, show_left_ui=False, show_right_ui=False)
        self._threads = set(threading.enumerate()) - others
        base = robot.model.body(robot.description.base).id
        with self.handle.lock():
            camera = self.handle.cam
            camera.lookat[:] = body_pose(robot.data, base)[:3, 3] + [0.1, 0.0, 0.15]
            camera.distance, camera.azimuth, camera.elevation = 1.8, 146.0, -14.0

    def is_open(self) -> bool:
        """Whether the person has not closed it."""
        return self.handle.is_running()

    def close(self) -> None:
        """Close it, and wait until its thread has drawn for the last time: at exit its library is taken down."""
        self.handle.close()
        for thread in self._threads:
            thread.join(_CLOSE_LIMIT)


class Window(Viewer):
    """Observer that shows the robot while it runs."""

    def __init__(self, robot: SimRobot) -> None:
        """Open the window on a robot."""
        super().__init__(robot)
        self._robot = robot
        self._base = robot.model.body(robot.description.base).id
        self._recent = Trace(_TRAIL_TICKS)

    def observe(self, tick: Tick) -> None:
        """Show a tick, and take over what was dragged."""
        self._recent.observe(tick)
        if tick.index % TICKS_PER_FRAME or not self.is_open():
            return
        scene = self.handle.user_scn
        with self.handle.lock():
            scene.ngeom = 0
            draw_trails(scene, list(self._recent), body_pose(self._robot.data, self._base))
        self.handle.sync()
