"""ik-service itself, in process, as the service calls it.

Settings: robot, preset, compiled, and keywords of `Solver.solve`: mode, collision.
"""

from functools import cache
from typing import Any

import numpy as np

from benchmarks.peers.model import Model
from ik_proto.robots import load_description
from ik_service.kernel import Kernel, load_kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solver import Solver


class Ours:
    """One solver; what a solution says besides q (errors, torques, clearance) is computed as ever and dropped here."""

    def __init__(self, settings: dict[str, Any]) -> None:
        self._robot, kernel = _load(settings["robot"], settings["compiled"])
        preset = Preset.of(load_description(settings["robot"]), settings["preset"])
        self._solver = Solver(self._robot, kernel, preset)
        self._keywords = {name: settings[name] for name in ("mode", "collision")}

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        return self._solver.solve(left, right, q, **self._keywords).q

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._robot.fk(q)


@cache
def _load(robot_name: str, compiled: bool) -> tuple[Robot, Kernel]:
    """One kernel serves all presets."""
    robot = Robot.load(load_description(robot_name))
    kernel = load_kernel(robot, compiled=compiled)
    if compiled and kernel.kind != "c":
        raise RuntimeError(f"no generated C here: {kernel.note}")
    return robot, kernel


def build(model: Model, settings: dict[str, Any]) -> Ours:  # noqa: ARG001 - ours reads its own description
    return Ours(settings)
