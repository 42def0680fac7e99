"""The seeds' formulation with the seeds' options: CasADi's Opti and Ipopt."""

from typing import Any

import numpy as np

from benchmarks.peers.model import Model
from ik_proto.robots import load_description
from ik_service.preset import Preset
from ik_service.reference import Reference
from ik_service.robot import Robot


class Ipopt:
    def __init__(self, robot: str, preset: str) -> None:
        description = load_description(robot)
        self._robot = Robot.load(description)
        self._reference = Reference(self._robot, Preset.of(description, preset))

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        return self._reference.solve(left, right, q)[0]

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._robot.fk(q)


def build(model: Model, settings: dict[str, Any]) -> Ipopt:  # noqa: ARG001 - ours reads its own description
    return Ipopt(settings["robot"], settings["preset"])
