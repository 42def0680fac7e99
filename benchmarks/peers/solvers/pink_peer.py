"""pink: differential IK, one quadratic program a step.

Settings: position_cost, orientation_cost, lm_damping, posture_cost, damping, qp, dt [s], velocity_limits, steps.
"""

from typing import Any

import numpy as np
import pinocchio as pin
from pink import Configuration, solve_ik
from pink.limits import ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, PostureTask

from benchmarks.peers.model import WRISTS, Model, close


class Pink:
    def __init__(self, model: Model, settings: dict[str, Any]) -> None:
        robot = pin.buildModelFromUrdf(str(model.urdf))
        if tuple(robot.names)[1:] != model.joint_names:
            raise RuntimeError("the joints come in another order")
        self._model, self._settings = model, settings
        self._configuration = Configuration(robot, robot.createData(), pin.neutral(robot))
        position, rotation = settings["position_cost"], settings["orientation_cost"]
        self._frames = [FrameTask(name, position, rotation, lm_damping=settings["lm_damping"]) for name in WRISTS]
        self._tasks = list(self._frames)
        if settings["posture_cost"]:
            posture = PostureTask(settings["posture_cost"])
            posture.set_target(pin.neutral(robot))
            self._tasks.append(posture)
        self._limits = [ConfigurationLimit(robot)]
        if settings["velocity_limits"]:
            self._limits.append(VelocityLimit(robot))

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        configuration, settings = self._configuration, self._settings
        configuration.update(self._model.inside(q))
        for task, target in zip(self._frames, (left, right), strict=True):
            task.set_target(pin.SE3(target))
        for step in range(settings["steps"]):
            if step and self._arrived(left, right):
                break
            velocity = solve_ik(
                configuration,
                self._tasks,
                settings["dt"],
                solver=settings["qp"],
                damping=settings["damping"],
                limits=self._limits,
                safety_break=False,
            )
            configuration.integrate_inplace(velocity, settings["dt"])
        return configuration.q

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._configuration.update(q)
        left, right = (self._configuration.get_transform_frame_to_world(name).homogeneous for name in WRISTS)
        return left, right

    def _arrived(self, left: np.ndarray, right: np.ndarray) -> bool:
        pose = self._configuration.get_transform_frame_to_world
        return all(close(pose(name).homogeneous, T) for name, T in zip(WRISTS, (left, right), strict=True))


def build(model: Model, settings: dict[str, Any]) -> Pink:
    return Pink(model, settings)
