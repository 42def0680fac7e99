"""Why an upper arm is missed: the first of the experiments that finds it names the cause."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from missed import A_FEW, Cause, Missed

from ik_service.solver import Solver

IDEAL, BEGIN = np.array([1.0]), np.array([0.0])
PLAIN, ASKED = {"target": "plain"}, {"target": "asked"}


class Steps:
    """A solver of one joint: from where it begins, a step for each answer; shares of it for a request."""

    def __init__(self, step: float = 0.0, **blocked: float) -> None:
        """Take the step of an answer, and of answers that are otherwise by what makes them so."""
        self.step, self.otherwise = step, blocked

    def solve(self, *, q: np.ndarray, weights: Any, collision: str, target: str) -> SimpleNamespace:
        del weights
        begin = "ideal" if q[0] >= 1.0 else "begin"
        step = self.otherwise.get(f"{begin}_{collision}_{target}", self.otherwise.get(f"{begin}_{collision}", None))
        return SimpleNamespace(q=q + (self.step if step is None else step))


def cause(solver: Steps) -> Cause:
    missed = Missed(cast(Solver, solver), np.ones((2, 2)), lambda q: bool(q[0] >= 1.0))
    return missed.cause(BEGIN, IDEAL, PLAIN, ASKED)


@pytest.mark.parametrize(
    ("solver", "named"),
    [
        (Steps(0.0), Cause.OTHER_BEND),
        (Steps(0.9 / A_FEW), Cause.OTHER_BEND),
        (Steps(1.1 / A_FEW), Cause.LATE),
        (Steps(0.1, begin_off=1.0), Cause.IN_THE_WAY),
        (Steps(0.0, begin_off=0.1), Cause.OTHER_BEND),
        (Steps(0.1, ideal_avoid=-2.0), Cause.OTHER_ARM),
        (Steps(0.0, ideal_off_asked=-2.0), Cause.MOVED),
        (Steps(0.0, ideal_off=-2.0), Cause.ASKED),
    ],
)
def test_the_first_experiment_that_finds_the_arm_names_the_cause(solver: Steps, named: Cause):
    assert cause(solver) is named
