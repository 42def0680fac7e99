"""Robotics Toolbox: Levenberg-Marquardt in C++ with random restarts, one arm at a time.

Settings: ilimit, slimit, tol.
"""

from typing import Any

import numpy as np
import roboticstoolbox as rtb

from benchmarks.peers.model import WRISTS, Model


class Toolbox:
    def __init__(self, model: Model, settings: dict[str, Any]) -> None:
        self._settings, self._parts = settings, model.parts
        self._arms = [
            rtb.Robot.URDF(str(path)).ets(start=model.base, end=wrist)
            for path, wrist in zip(model.arm_urdfs, WRISTS, strict=True)
        ]

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        answer = q.copy()
        for arm, target, part in zip(self._arms, (left, right), self._parts, strict=True):
            found = arm.ik_LM(target, q0=q[part], joint_limits=True, **self._settings)
            if found.success:
                answer[part] = found.q
        return answer

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        left, right = (arm.fkine(q[part]).A for arm, part in zip(self._arms, self._parts, strict=True))
        return left, right


def build(model: Model, settings: dict[str, Any]) -> Toolbox:
    return Toolbox(model, settings)
