"""Why an upper arm is not like the person's although it could be: experiments with the one request that missed it.

Each experiment makes one thing better than it was. The first that finds the person's upper arm names the cause; the
order goes from what is asked for to where the solver began.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from skinned_person import Array

from ik_service.solver import Solver

A_FEW = 15
"""Answers, each from the one before it, in which what comes late has come: 0.3 s of them."""


class Cause(StrEnum):
    """Why an upper arm is missed."""

    ASKED = "asked"
    """Not even an arm that is there, and passes through everything, stays: the solver's weights are against it."""
    MOVED = "moved"
    """It stays if the forearm is not turned out of the body: that turn is against it."""
    OTHER_ARM = "other arm"
    """An arm that is there cannot stay: the other one is in its place, or so near that it must not."""
    IN_THE_WAY = "in the way"
    """It would get there at once, if body and arms were not in the way from where the robot is."""
    LATE = "late"
    """It gets there with a few answers, each from the one before it: the robot is behind, and its elbow too."""
    OTHER_BEND = "other bend"
    """It does not: the robot is so far behind that its arm ends in another bend."""


@dataclass(frozen=True)
class Missed:
    """An arm in a tick.

    Attributes:
        solver: Solves.
        weights: Of the targets.
        like: Says whether the arm of a posture is like the person's.
    """

    solver: Solver
    weights: Array
    like: Callable[[Array], bool]

    def cause(self, q: Array, ideal: Array, plain: Mapping[str, Any], asked: Mapping[str, Any]) -> Cause:
        """Find out why.

        Args:
            q: Where the solver began [rad].
            ideal: The same with the arm where it should be [rad].
            plain: What would be asked for as the person has it.
            asked: What was asked for.
        """
        if not self._comes(ideal, asked, "off"):
            return Cause.MOVED if self._comes(ideal, plain, "off") else Cause.ASKED
        if not self._comes(ideal, asked, "avoid"):
            return Cause.OTHER_ARM
        if self._comes(q, asked, "off", answers=1):
            return Cause.IN_THE_WAY
        return Cause.LATE if self._comes(q, asked, "avoid") else Cause.OTHER_BEND

    def _comes(self, q: Array, asked: Mapping[str, Any], collision: Any, answers: int = A_FEW) -> bool:
        """Whether the arm is like the person's after some answers, each from the one before it."""
        for _ in range(answers):
            q = self.solver.solve(q=q, weights=self.weights, collision=collision, **asked).q
        return self.like(q)
