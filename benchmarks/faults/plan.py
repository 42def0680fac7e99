"""What is done to whom, and when: the faults of a run, drawn from a seed."""

import itertools
import random
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

MOVES_BEFORE = (0.3, 1.5)
"""How long the robot follows before the next fault [s]."""

STOPPED = (0.05, 2.0)
"""How long a stopped process stays stopped [s]."""


class Victim(StrEnum):
    """Whom it happens to."""

    SERVICE = "service"
    OPERATOR = "operator"


class Kind(StrEnum):
    """What happens."""

    KILL = "kill"
    """SIGKILL, then a new process."""
    STOP = "stop"
    """SIGSTOP, and SIGCONT after a while."""
    TERM = "term"
    """SIGTERM, then a new process."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One cycle.

    Attributes:
        victim: Whom it happens to.
        kind: What happens.
        after: How long the robot has followed by then [s].
        lasts: How long a stopped process stays stopped [s]; 0 for the others.
    """

    victim: Victim
    kind: Kind
    after: float
    lasts: float = 0.0

    def __str__(self) -> str:
        """In words."""
        return f"{self.kind} {self.victim}" + (f" for {self.lasts:.2f} s" if self.kind is Kind.STOP else "")


def plan(cycles: int, seed: int) -> Iterator[Fault]:
    """Draw the faults: every combination once in each round of six, in random order, at random instants.

    Args:
        cycles: How many.
        seed: Decides all of it.
    """
    rng = random.Random(seed)
    combinations = list(itertools.product(Victim, Kind))
    for k in range(cycles):
        if k % len(combinations) == 0:
            rng.shuffle(combinations)
        victim, kind = combinations[k % len(combinations)]
        lasts = rng.uniform(*STOPPED) if kind is Kind.STOP else 0.0
        yield Fault(victim, kind, rng.uniform(*MOVES_BEFORE), lasts)
