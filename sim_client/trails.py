"""Draws where the wrists and their targets have just been, as fading trails.

A target's trail is thin and pale, a wrist's is thick and in the arm's colour: where they lie on each other, the arm
follows well.
"""

from collections.abc import Sequence
from itertools import pairwise

import mujoco
import numpy as np

from ik_proto import Array
from sim_client.scene import COLOURS
from sim_client.trace import Tick

TRAIL_TICKS = 125
"""How far back a trail reaches [ticks]."""

_STRIDE = 3
_WRIST_WIDTH = 5.0
_TARGET_WIDTH = 2.5
_TARGET_COLOUR = np.array([1.0, 1.0, 1.0])


def draw_trails(scene: mujoco.MjvScene, ticks: Sequence[Tick], T_world_pelvis: Array) -> None:
    """Add the trails of some ticks to a scene.

    Args:
        scene: About to be rendered.
        ticks: Oldest first; the trail ends at the last.
        T_world_pelvis: Base pose, shape (4, 4) [m].
    """
    recent = ticks[-TRAIL_TICKS:]
    picked = recent[(len(recent) - 1) % _STRIDE :: _STRIDE]
    for arm, colour in enumerate(COLOURS):
        wrists = [tick.wrists[arm] for tick in picked]
        targets = [tick.targets[arm] for tick in picked]
        _draw_trail(scene, targets, _TARGET_COLOUR, _TARGET_WIDTH, T_world_pelvis)
        _draw_trail(scene, wrists, np.array(colour), _WRIST_WIDTH, T_world_pelvis)


def _draw_trail(
    scene: mujoco.MjvScene, poses: Sequence[Array | None], colour: Array, width: float, T_world_pelvis: Array
) -> None:
    for place, (begin, end) in enumerate(pairwise(poses), start=1):
        if begin is None or end is None:
            continue
        opacity = (place / len(poses)) ** 1.5
        _add_segment(scene, _in_world(begin, T_world_pelvis), _in_world(end, T_world_pelvis), width, colour, opacity)


def _add_segment(scene: mujoco.MjvScene, begin: Array, end: Array, width: float, colour: Array, opacity: float) -> None:
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    line = mujoco.mjtGeom.mjGEOM_LINE
    rgba = np.array([*colour, opacity], dtype=np.float32)
    mujoco.mjv_initGeom(geom, line, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
    mujoco.mjv_connector(geom, line, width, begin, end)
    scene.ngeom += 1


def _in_world(T_pelvis: Array, T_world_pelvis: Array) -> Array:
    return T_world_pelvis[:3, :3] @ T_pelvis[:3, 3] + T_world_pelvis[:3, 3]
