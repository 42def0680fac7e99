"""One source of commands at a time, and each of its commands once.

- The first session that sends holds the robot, until it has been silent for `LEASE` or the arms are given back. Others
  are told that it is busy.
- Of a session only rising numbers count; what is repeated, late or replayed does not. Numbers are remembered beyond the
  end of a session, so that a recording of it cannot be played later.
"""

from enum import StrEnum

LEASE = 1.0
"""How long a session holds the robot without a command [s]."""

_REMEMBERED = 64
"""Sessions whose last number is remembered."""


class Reception(StrEnum):
    """What became of a command."""

    ACCEPTED = "accepted"
    BUSY = "busy"
    """Another session holds the robot."""
    OLD = "old"
    """Its number is not larger than the last one of its session."""
    BAD = "bad"
    """It is no command for this robot."""


class Lease:
    """Decides whose commands count."""

    def __init__(self, lease: float = LEASE) -> None:
        """Start without a holder.

        Args:
            lease: How long a session holds the robot without a command [s].
        """
        self._lease = lease
        self._holder: str | None = None
        self._heard = 0.0
        self._last_seq: dict[str, int] = {}

    def admit(self, session: str, seq: int, now: float) -> Reception:
        """Judge a command.

        Args:
            session: The run of the loop that sends it.
            seq: Its number in the session.
            now: When it came [s], monotonic.

        Returns:
            Accepted, busy or old.
        """
        if self.busy_for(session, now):
            return Reception.BUSY
        if seq <= self._last_seq.get(session, seq - 1):
            return Reception.OLD
        self._holder, self._heard = session, now
        self._last_seq.pop(session, None)
        self._last_seq[session] = seq  # The newest is last, so that the longest unused is forgotten first.
        if len(self._last_seq) > _REMEMBERED:
            del self._last_seq[next(iter(self._last_seq))]
        return Reception.ACCEPTED

    def busy_for(self, session: str, now: float) -> bool:
        """Whether another session holds the robot.

        Args:
            session: The one that asks.
            now: Time [s], monotonic.
        """
        return self._holder not in (None, session) and 0.0 <= now - self._heard <= self._lease

    def free(self) -> None:
        """Take the robot from its holder."""
        self._holder = None
