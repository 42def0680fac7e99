"""roboplan-oink: differential IK in C++, one quadratic program a step.

Settings: position_cost, orientation_cost, lm_damping, regularization, velocity_limits, steps.
"""

from typing import Any

import numpy as np
from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescription
from roboplan.optimal_ik import (
    FrameTask,
    FrameTaskOptions,
    Oink,
    PositionLimit,
    VelocityLimit,
)

from benchmarks.peers.model import PERIOD, WRISTS, Model, close


class RoboplanOink:
    def __init__(self, model: Model, settings: dict[str, Any]) -> None:
        self._model, self._steps = model, settings["steps"]
        self._regularization = settings["regularization"]
        self._scene = Scene("arms", loadUrdfSceneDescription(str(model.urdf), []))
        self._oink = Oink(self._scene)
        names = list(self._scene.getJointNames())
        self._places = np.array([names.index(name) for name in model.joint_names])
        costs = {key: settings[key] for key in ("position_cost", "orientation_cost", "lm_damping")}
        self._frames = [
            FrameTask(
                self._oink,
                self._scene,
                CartesianConfiguration(model.base, name, np.asfortranarray(np.eye(4))),
                FrameTaskOptions(**costs),
            )
            for name in WRISTS
        ]
        count = self._oink.num_variables
        self._limits = [PositionLimit(self._oink, 1.0)]
        if settings["velocity_limits"]:
            velocity = np.zeros(count)
            velocity[self._places] = model.velocity
            self._limits.append(VelocityLimit(self._oink, PERIOD, velocity))
        self._step, self._q = np.zeros(count), np.zeros(count)

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        position = self._q
        position[self._places] = self._model.inside(q)
        for task, target in zip(self._frames, (left, right), strict=True):
            task.setTargetFrameTransform(np.asfortranarray(target))
        for step in range(self._steps):
            if step and self._arrived(left, right):
                break
            self._scene.setJointPositions(position)
            self._oink.solveIk(self._scene, self._frames, self._limits, [], self._step, self._regularization)
            position += self._step
        return position[self._places]

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._q[self._places] = q
        left, right = (np.array(self._scene.forwardKinematics(self._q, name)) for name in WRISTS)
        return left, right

    def _arrived(self, left: np.ndarray, right: np.ndarray) -> bool:
        pose = self._scene.forwardKinematics
        return all(close(pose(self._q, name), T) for name, T in zip(WRISTS, (left, right), strict=True))


def build(model: Model, settings: dict[str, Any]) -> RoboplanOink:
    return RoboplanOink(model, settings)
