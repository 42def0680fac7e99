"""The window on a robot that runs alone: the robot, and how its wrists move where a loop says so."""

import mujoco

from sim_client.motion_arrows import draw_motion, place_marks
from sim_client.motion_panel import SIZE, draw_panel
from sim_client.motion_view import look
from sim_client.robot import SimRobot
from sim_client.window import TICKS_PER_FRAME, Viewer

_TICKS_PER_PANEL = 3 * TICKS_PER_FRAME
"""The panel takes some milliseconds to draw."""

_CORNER = (12, 12)
"""Where its lower left corner is in the window [pixel]."""


class MotionWindow(Viewer):
    """A viewer with arrows at the wrists and a panel of bars."""

    def __init__(self, robot: SimRobot) -> None:
        """Open the window on a robot."""
        super().__init__(robot)
        self._robot = robot
        self._panel = mujoco.MjrRect(*_CORNER, *SIZE)
        self._panel_shown = False

    def show(self) -> None:
        """Show the robot after a control tick."""
        if self._robot.ticks % TICKS_PER_FRAME or not self.is_open():
            return
        view = look(self._robot)
        with self.handle.lock():
            place_marks(self._robot, view)
            self.handle.user_scn.ngeom = 0
            if view is not None:
                draw_motion(self.handle.user_scn, self._robot, view)
        if view is not None and self._robot.ticks % _TICKS_PER_PANEL == 0:
            self.handle.set_images((self._panel, draw_panel(view)))
            # Not only to be read: behind textures MuJoCo draws pictures only where it has drawn a text before them.
            self.handle.set_texts((None, mujoco.mjtGridPos.mjGRID_TOPLEFT, "wrists", "asked yellow, measured green"))
            self._panel_shown = True
        elif view is None and self._panel_shown:
            self.handle.clear_images()
            self.handle.clear_texts()
            self._panel_shown = False
        self.handle.sync()
