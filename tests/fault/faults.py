"""What a network does to messages, and in which order: a plan by a seed or by Hypothesis, so it can be repeated."""

import random
import threading
from collections.abc import Iterable, Sequence
from enum import StrEnum


class Fault(StrEnum):
    """What happens to one message."""

    PASS = "pass"
    SPLIT = "split"
    """It comes in small pieces."""
    DELAY = "delay"
    """It comes a little later."""
    DROP = "drop"
    """It never comes."""
    DUPLICATE = "duplicate"
    """It comes twice."""
    LATE = "late"
    """It comes just before the next one: out of order, and when nobody waits for it any more."""
    TRUNCATE = "truncate"
    """Half of it comes, then the connection breaks."""
    STALL = "stall"
    """Half of it comes, then nothing."""
    CORRUPT = "corrupt"
    """Something else comes. Never a digit for a digit: that is for TCP's checksum, or TLS, to notice."""
    RESET = "reset"
    """The connection is reset in its place."""


LOSES = frozenset({Fault.DROP, Fault.LATE, Fault.TRUNCATE, Fault.STALL, Fault.RESET})


class Plan:
    """The faults of one direction, one for each message; after the last everything passes. Safe between threads.

    Attributes:
        seen: How many messages have asked.
    """

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        """Take the faults in order."""
        self._lock = threading.Lock()
        self._faults = list(faults)
        self.seen = 0

    @classmethod
    def random(cls, rng: random.Random, length: int, share: float, faults: Sequence[Fault] = tuple(Fault)) -> "Plan":
        """Draw a plan.

        Args:
            rng: Where the choices come from.
            length: How many messages it is for.
            share: Share of them to which something happens.
            faults: What may happen.
        """
        return cls(rng.choice(faults) if rng.random() < share else Fault.PASS for _ in range(length))

    def next(self) -> Fault:
        """What happens to the next message."""
        with self._lock:
            self.seen += 1
            return self._faults.pop(0) if self._faults else Fault.PASS

    def mend(self) -> None:
        """Let everything pass from now on."""
        with self._lock:
            self._faults.clear()
