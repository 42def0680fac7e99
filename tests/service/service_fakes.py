"""Stand-ins and material of the service's tests."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ik_proto import Status
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.service import Service
from ik_service.solution import BatchSolution, Solution

OPEN = [-0.3, 0.35, 0.0, 1.0, 0.0, 0.0, 0.0, -0.3, -0.35, 0.0, 1.0, 0.0, 0.0, 0.0]
"""Arms a little away from the body, hands in front [rad]."""


class StubSolver:
    """Stands in for a solver: notes what it is asked, gives a status or raises."""

    def __init__(self, outcome: Status | Exception) -> None:
        self.outcome = outcome
        self.asked: dict[str, Any] = {}

    def solve(self, left_wrist: np.ndarray, right_wrist: np.ndarray, q: np.ndarray, **options: Any) -> Solution:
        self.asked = options
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return Solution(q.copy(), self.outcome, np.zeros(2), np.zeros(2), np.zeros(len(q)), 0.0, 3, math.inf, None)

    def solve_batch(self, left_wrist: np.ndarray, right_wrist: np.ndarray, q: np.ndarray, **options: Any) -> Any:
        alone = [self.solve(*row, **options) for row in zip(left_wrist, right_wrist, q, strict=True)]
        alone[0].status = Status.OK
        return BatchSolution.of(alone)


def service_with(engine: Engine, outcome: Status | Exception, meter: Meter | None = None, **options: Any) -> Service:
    solvers: dict[str, Any] = {engine.about.default_preset: StubSolver(outcome)}
    return Service(replace(engine, solvers=solvers), meter or Meter("test"), **options)


def batch_of(documents: list[dict[str, Any]], **shared: Any) -> dict[str, Any]:
    """A `solve_batch` of these requests; what they share is taken from the first."""
    arrays = {name for name, value in documents[0].items() if isinstance(value, list)}
    rows = {name: [row[name] for row in documents] for name in arrays}
    first = {name: value for name, value in documents[0].items() if name not in arrays}
    return {**first, **rows, "verb": "solve_batch", **shared}
