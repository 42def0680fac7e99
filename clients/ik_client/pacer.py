"""Keeps a loop on a schedule that is fixed when it begins, so that oversleeping never adds up.

After a gap longer than `MAX_BACKLOG` the schedule is moved: missed ticks are not made up for.
"""

import time
from collections.abc import Callable

MAX_BACKLOG = 0.05
"""How far behind schedule a loop tries to catch up [s]."""


class Pacer:
    """Says when the next tick is due.

    Attributes:
        period: Time between two ticks [s].
        late: Ticks that began later than one period after they were due.
        moved: How often the schedule was moved.
        behind: How long after it was due the latest tick began [s].
    """

    def __init__(
        self,
        period: float,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Make the first tick due at once.

        Args:
            period: Time between two ticks [s].
            clock: Monotonic time [s].
            sleep: Waits for a time [s].
        """
        self.late = 0
        self.moved = 0
        self.behind = 0.0
        self.period = period
        self._clock = clock
        self._sleep = sleep
        self._due: float | None = None

    @property
    def due(self) -> float | None:
        """When the latest tick was due [s]; None before the first."""
        return self._due

    def shift(self, by: float) -> None:
        """Move the schedule.

        Args:
            by: How much later ticks become due, negative for earlier [s].
        """
        if self._due is not None:
            self._due += by

    def wait(self) -> None:
        """Wait until the next tick is due."""
        now = self._clock()
        due = now if self._due is None else self._due + self.period
        self._due = due
        if now < due:
            self._sleep(due - now)
        elif now - due > MAX_BACKLOG:
            self._due, self.moved = now, self.moved + 1
        self.behind = max(self._clock() - due, 0.0)
        self.late += self.behind > self.period
