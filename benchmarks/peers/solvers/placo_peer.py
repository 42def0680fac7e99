"""placo: differential IK in C++, one quadratic program a step.

Settings: position_weight, orientation_weight, regularization (0: placo's own), velocity_limits, steps.
"""

from typing import Any

import numpy as np
import placo

from benchmarks.peers.model import PERIOD, WRISTS, Model, close


class Placo:
    def __init__(self, model: Model, settings: dict[str, Any]) -> None:
        self._model, self._steps = model, settings["steps"]
        self._robot = placo.RobotWrapper(str(model.urdf), placo.Flags.ignore_collisions)
        self._solver = placo.KinematicsSolver(self._robot)
        self._solver.dt = PERIOD
        self._solver.mask_fbase(True)
        self._solver.enable_joint_limits(True)
        self._solver.enable_velocity_limits(settings["velocity_limits"])
        self._frames = []
        for name in WRISTS:
            task = self._solver.add_frame_task(name, np.eye(4))
            task.configure(name, "soft", settings["position_weight"], settings["orientation_weight"])
            self._frames.append(task)
        if settings["regularization"]:
            self._solver.add_regularization_task(settings["regularization"])
        self._places = np.array([self._robot.get_joint_offset(name) for name in model.joint_names])

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        self._set(self._model.inside(q))
        for task, target in zip(self._frames, (left, right), strict=True):
            task.T_world_frame = target
        for step in range(self._steps):
            if step and self._arrived(left, right):
                break
            self._solver.solve(True)
            self._robot.update_kinematics()
        return self._robot.state.q[self._places]

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._set(q)
        left, right = (self._robot.get_T_world_frame(name) for name in WRISTS)
        return left, right

    def _set(self, q: np.ndarray) -> None:
        state = self._robot.state.q.copy()
        state[self._places] = q
        self._robot.state.q = state
        self._robot.update_kinematics()

    def _arrived(self, left: np.ndarray, right: np.ndarray) -> bool:
        pose = self._robot.get_T_world_frame
        return all(close(pose(name), T) for name, T in zip(WRISTS, (left, right), strict=True))


def build(model: Model, settings: dict[str, Any]) -> Placo:
    return Placo(model, settings)
