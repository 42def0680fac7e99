"""Whether the IK service can be followed: it answers, its answers are usable, and it is still the same run of it.

| what happens                                           | what follows                                  |
|--------------------------------------------------------|-----------------------------------------------|
| one answer fails                                       | nothing but that tick's                       |
| nothing is heard for longer than `patience`            | trouble, until the service is heard again     |
| answers cannot be used, as long or `failures` in a row | trouble, until no arm is engaged              |
| another run of the service answers                     | the operator's grip counts no longer          |

A run that answers first, or while no arm is engaged, is simply taken note of.
"""


class ServiceWatch:
    """Counts what the service does. One per loop.

    Attributes:
        boot_id: The run of the service that answered last; empty before any answer.
    """

    def __init__(self, *, failures: int = 10, patience: float = 0.1) -> None:
        """Start without an opinion.

        Args:
            failures: Failed answers in a row that make trouble.
            patience: How long answers may fail [s].
        """
        self.boot_id = ""
        self._limit = failures
        self._patience = patience
        self._failures = 0
        self._since = 0.0
        self._fault = ""
        self._silent = True
        self._changed = False

    @property
    def answers(self) -> bool:
        """Whether nothing has failed since it was heard last."""
        return not self._failures

    def answered(self, boot_id: str, *, engaged: bool) -> bool:
        """Take note of an answer, of whatever kind.

        Args:
            boot_id: The run that gave it.
            engaged: Whether an arm follows what another answer began.

        Returns:
            Whether it may be used: it comes from the run that the operator gripped for.
        """
        same = not engaged or not self.boot_id or boot_id == self.boot_id
        self.boot_id = boot_id
        self._changed = self._changed or not same
        return same

    def succeeded(self) -> None:
        """Note that a solution could be used."""
        self._failures = 0

    def heard(self, *, engaged: bool) -> None:
        """Note that the service answers, if not with a solution.

        Args:
            engaged: Whether an arm waits for solutions; those may still be as useless as before.
        """
        if self._silent or not engaged:
            self._failures = 0

    def failed(self, fault: str, now: float, *, silent: bool = False) -> None:
        """Note that a solution could not be used, or did not come.

        Args:
            fault: Why, in one line.
            now: Time of the tick [s].
            silent: Whether nothing was heard of the service at all.
        """
        self._silent = silent
        if not self._failures:
            self._since = now
        self._failures += 1
        self._fault = fault

    def trouble(self, now: float) -> str:
        """Why the service cannot be followed; empty where it can.

        Args:
            now: Time of the tick [s].
        """
        # Written so that a clock that stepped back counts as too long.
        waited = self._failures > 0 and not 0.0 <= now - self._since <= self._patience
        return self._fault if waited or self._failures >= self._limit else ""

    def revoked(self) -> str:
        """Why the grip counts no longer; empty where it does. Asking settles it."""
        changed, self._changed = self._changed, False
        return "another run of the service answers now: grip again" if changed else ""
