"""mink: pink's ideas on MuJoCo.

Settings: position_cost, orientation_cost, lm_damping, posture_cost, damping, qp, dt [s], velocity_limits, steps.
"""

from typing import Any

import mink
import mujoco
import numpy as np

from benchmarks.peers.model import WRISTS, Model, close


class Mink:
    def __init__(self, model: Model, settings: dict[str, Any]) -> None:
        robot = mujoco.MjModel.from_xml_path(str(model.mjcf))
        if tuple(robot.joint(i).name for i in range(robot.njnt)) != model.joint_names:
            raise RuntimeError("the joints come in another order")
        self._model, self._settings = model, settings
        self._configuration = mink.Configuration(robot)
        costs = {key: settings[key] for key in ("position_cost", "orientation_cost", "lm_damping")}
        self._frames = [mink.FrameTask(name, "site", **costs) for name in WRISTS]
        self._tasks = list(self._frames)
        if settings["posture_cost"]:
            posture = mink.PostureTask(robot, cost=settings["posture_cost"])
            posture.set_target(np.zeros(robot.nq))
            self._tasks.append(posture)
        self._limits = [mink.ConfigurationLimit(robot)]
        if settings["velocity_limits"]:
            limits = dict(zip(model.joint_names, model.velocity, strict=True))
            self._limits.append(mink.VelocityLimit(robot, limits))

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        configuration, settings = self._configuration, self._settings
        configuration.update(self._model.inside(q))
        for task, target in zip(self._frames, (left, right), strict=True):
            task.set_target(mink.SE3.from_matrix(target))
        for step in range(settings["steps"]):
            if step and self._arrived(left, right):
                break
            velocity = mink.solve_ik(
                configuration,
                self._tasks,
                settings["dt"],
                settings["qp"],
                settings["damping"],
                limits=self._limits,
            )
            configuration.integrate_inplace(velocity, settings["dt"])
        return configuration.q.copy()

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._configuration.update(q)
        left, right = (self._pose(name) for name in WRISTS)
        return left, right

    def _pose(self, name: str) -> np.ndarray:
        return self._configuration.get_transform_frame_to_world(name, "site").as_matrix()

    def _arrived(self, left: np.ndarray, right: np.ndarray) -> bool:
        return all(close(self._pose(name), T) for name, T in zip(WRISTS, (left, right), strict=True))


def build(model: Model, settings: dict[str, Any]) -> Mink:
    return Mink(model, settings)
