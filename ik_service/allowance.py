"""How often something may be done: a token bucket. Pure; time is passed in."""


class Allowance:
    """Grants one thing at a time, so many a second, and some at once after a pause."""

    __slots__ = ("_at", "_burst", "_left", "_per_s")

    def __init__(self, per_s: float, burst: int, now: float) -> None:
        """Start with a full burst.

        Args:
            per_s: Grants a second in the long run.
            burst: Most grants at once.
            now: The time [s].
        """
        self._per_s = per_s
        self._burst = float(burst)
        self._left = self._burst
        self._at = now

    def take(self, now: float) -> float:
        """Take one.

        Args:
            now: The time [s], not before that of the call before.

        Returns:
            0 where it is granted; otherwise nothing is taken, and this is the time until one will be [s].
        """
        left = self._left + (now - self._at) * self._per_s
        self._left = left = left if left < self._burst else self._burst
        self._at = now
        if left < 1.0:
            return (1.0 - left) / self._per_s
        self._left = left - 1.0
        return 0.0
