"""When to try a failing service again.

The first failure costs nothing: a single late reply must not become a pause. From the second in a row on, each doubles
the pause, up to half a second, so that a dead host costs a control loop its timeout once in a while and not every tick.
"""


class Backoff:
    """Counts failures in a row."""

    def __init__(self, first: float = 0.02, limit: float = 0.5) -> None:
        """Start without failures.

        Args:
            first: Pause after the second failure in a row [s].
            limit: Longest pause [s].
        """
        self._first = first
        self._limit = limit
        self._failures = 0
        self._until = float("-inf")

    def failed(self, now: float) -> None:
        """Count a failure.

        Args:
            now: When it was noticed [s].
        """
        self._failures += 1
        if self._failures > 1:
            self._until = now + min(self._limit, self._first * 2.0 ** min(self._failures - 2, 32))

    def succeeded(self) -> None:
        """Forget the failures."""
        self._failures = 0
        self._until = float("-inf")

    def pausing(self, now: float) -> bool:
        """Whether it is too early to try again."""
        return now < self._until
