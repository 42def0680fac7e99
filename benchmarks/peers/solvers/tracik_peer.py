"""TRAC-IK: Newton and SQP side by side with random restarts, in C++, one arm at a time.

Its two halves run in threads of their own, as TRAC-IK is made. Settings: timeout [s], epsilon, solve_type.
"""

from typing import Any

import numpy as np
import pytracik

from benchmarks.peers.model import WRISTS, Model, quaternion


class TracIk:
    def __init__(self, model: Model, settings: dict[str, Any]) -> None:
        self._parts = model.parts
        kind = getattr(pytracik.SolveType, settings["solve_type"])
        self._arms = [
            pytracik.TRAC_IK(model.base, wrist, path.read_text(), settings["timeout"], settings["epsilon"], kind)
            for path, wrist in zip(model.arm_urdfs, WRISTS, strict=True)
        ]

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        answer = q.copy()
        for arm, target, part in zip(self._arms, (left, right), self._parts, strict=True):
            w, x, y, z = quaternion(target[:3, :3])
            found = pytracik.ik(arm, q[part], *target[:3, 3], x, y, z, w)
            if found.size and found[0] >= 0:  # the first number tells of success
                answer[part] = found[1:]
        return answer

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        left, right = (np.asarray(pytracik.fk(arm, q[part])) for arm, part in zip(self._arms, self._parts, strict=True))
        return left, right


def build(model: Model, settings: dict[str, Any]) -> TracIk:
    return TracIk(model, settings)
