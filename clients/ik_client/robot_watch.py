"""Whether the robot's end goes along: it can be read, it is ready, and it follows once an arm is engaged."""

from ik_client.types import RobotState

FOLLOWS_WITHIN = 0.2
"""How long the robot's end may take to follow after an arm was engaged [s]: a state that is under way is older."""


class RobotWatch:
    """Judges what the robot's end says of itself. One per loop, one look per tick."""

    def __init__(self, follows_within: float = FOLLOWS_WITHIN) -> None:
        """Start without an opinion.

        Args:
            follows_within: How long the robot's end may take to follow [s].
        """
        self._follows_within = follows_within
        self._idle_since: float | None = None
        self._state: RobotState | None = None
        self._fault = ""

    def look(self, state: RobotState | None, fault: str, engaged: bool, now: float) -> None:
        """Take in a tick.

        Args:
            state: What the robot says; None where it cannot be read.
            fault: Why it cannot.
            engaged: Whether the last command said that an arm is engaged.
            now: Time of the tick [s].
        """
        self._state, self._fault = state, fault
        if state is None or state.following or not engaged:
            self._idle_since = None
        elif self._idle_since is None:
            self._idle_since = now

    def trouble(self) -> str:
        """Why no arm can follow now; empty where one can."""
        if self._state is None:
            return self._fault
        return "" if self._state.ready else f"the robot is not ready: {self._state.note}".rstrip(": ")

    def revoked(self, now: float) -> str:
        """Why the grip counts no longer; empty where it does.

        Args:
            now: Time of the tick [s].
        """
        idle = self._idle_since
        if idle is None or 0.0 <= now - idle <= self._follows_within or self._state is None:
            return ""
        return f"the robot does not follow: {self._state.note}".rstrip(": ")
