"""OptIK: SLSQP with random restarts, in Rust, one arm at a time, on one thread like everyone here.

Settings: solution_mode, max_time [s], tol_f.
"""

from typing import Any

import numpy as np
import optik

from benchmarks.peers.model import WRISTS, Model


class Optik:
    def __init__(self, model: Model, settings: dict[str, Any]) -> None:
        self._parts = model.parts
        self._config = optik.SolverConfig(**settings)
        self._arms = [
            optik.Robot.from_urdf_file(str(path), model.base, wrist)
            for path, wrist in zip(model.arm_urdfs, WRISTS, strict=True)
        ]
        for arm in self._arms:
            arm.set_parallelism(1)

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        answer = q.copy()
        for arm, target, part in zip(self._arms, (left, right), self._parts, strict=True):
            found = arm.ik(self._config, target, q[part])
            if found is not None:
                answer[part] = found[0]
        return answer

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        left, right = (np.array(arm.fk(q[part])) for arm, part in zip(self._arms, self._parts, strict=True))
        return left, right


def build(model: Model, settings: dict[str, Any]) -> Optik:
    return Optik(model, settings)
