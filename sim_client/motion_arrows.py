"""Draws at each wrist how it shall move and how it does, as arrows.

The asked velocity is thick, pale and yellow; the measured one thin and green inside it. Where the green arrow fills the
yellow one, the hand does what it is asked to. A turn is an arrow along its axis, half as thick.
"""

import mujoco
import numpy as np

from ik_proto import Array
from sim_client.model import WRIST_SITES, body_pose
from sim_client.motion_view import MotionView
from sim_client.robot import SimRobot

ASKED, MEASURED = (0.98, 0.80, 0.10), (0.05, 0.62, 0.20)
"""Red, green, blue of the two arrows."""

AHEAD = 1.5
"""An arrow ends where the wrist would be after this time [s]."""

PER_TURN = 0.3
"""Length of the arrow of a turn [m s/rad]."""

_RADII, _OPACITIES = (0.016, 0.009), (0.4, 1.0)
_THINNER = 0.5
_SHORTEST = 0.01
"""An arrow shorter than this is left out [m]: 7 mm/s, or 2 degrees a second."""


def draw_motion(scene: mujoco.MjvScene, robot: SimRobot, view: MotionView) -> None:
    """Add the arrows to a scene.

    Args:
        scene: About to be rendered.
        robot: After a control tick.
        view: How its wrists move.
    """
    R = body_pose(robot.data, robot.model.body(robot.description.base).id)[:3, :3]
    kinds = zip((view.motion.twists, view.measured), (ASKED, MEASURED), _RADII, _OPACITIES, strict=True)
    for twists, colour, radius, opacity in kinds:
        rgba = np.array([*colour, opacity])
        for site, twist in zip(WRIST_SITES, twists, strict=True):
            begin = robot.data.site(site).xpos
            _add_arrow(scene, begin, AHEAD * R @ twist[:3], radius, rgba)
            _add_arrow(scene, begin, PER_TURN * R @ twist[3:], _THINNER * radius, rgba)


def place_marks(robot: SimRobot, view: MotionView | None) -> None:
    """Put the targets, of which a robot alone has none, where they hide the wrists' own marks, or out of the way.

    Args:
        robot: The robot.
        view: How its wrists move; None where there is nothing to see.
    """
    inside = np.eye(4)
    robot.show_targets(*(robot.wrists() if view is None else (inside, inside)))


def _add_arrow(scene: mujoco.MjvScene, begin: Array, way: Array, radius: float, rgba: Array) -> None:
    if np.linalg.norm(way) < _SHORTEST or scene.ngeom >= scene.maxgeom:
        return
    geom, arrow = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_ARROW
    mujoco.mjv_initGeom(geom, arrow, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba.astype(np.float32))
    mujoco.mjv_connector(geom, arrow, radius, begin, begin + way)
    scene.ngeom += 1
