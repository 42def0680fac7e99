"""Tells in words when a page comes and goes. Pure: asked once per tick."""

from collections.abc import Iterator

_MODEST = 1.0
"""After how long a page that does not say what it runs on is announced without [s]."""


class Visitors:
    """Notes which page is connected."""

    def __init__(self) -> None:
        """Start without a page."""
        self._connection = 0
        self._since = 0.0
        self._here = False
        self._announced = False

    def look(self, connections: int, connected: bool, device: str, now: float) -> Iterator[str]:
        """Look who is there.

        Args:
            connections: How many pages have connected so far.
            connected: Whether one is connected now.
            device: What it runs on, in its own words; empty until it has said so.
            now: Monotonic time [s].

        Yields:
            What has changed, a line each.
        """
        if self._here and (not connected or connections != self._connection):
            self._here = False
            yield f"the page has gone after {now - self._since:.0f} s"
        if connected and not self._here:
            self._here, self._announced = True, False
            self._connection, self._since = connections, now
        if self._here and not self._announced and (device or now - self._since > _MODEST):
            self._announced = True
            yield f"a page has connected: {device or 'it does not say on what device'}"
