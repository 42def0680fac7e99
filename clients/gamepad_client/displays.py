"""Where the status goes: a window, a live table in the terminal, or nowhere; and where lines go."""

from collections.abc import Callable

from gamepad_client.status import Status
from ik_client.devices import Devices

Say = Callable[[str], None]

_WINDOW_EVERY, _TABLE_EVERY = 0.05, 0.2
"""Time between two views [s]."""


class Display:
    """Shows statuses as often as is of use. Use it in a `with` block."""

    def __init__(self, devices: Devices, say: Say, *, terminal: bool) -> None:
        """Choose.

        Args:
            devices: With a window, or without.
            say: Tells a person a line.
            terminal: Whether the output is a terminal.
        """
        self.say = say
        self._every, self._shown = _WINDOW_EVERY, -float("inf")
        self._show: Callable[[Status], None] | None = None
        self._close: Callable[[], None] = lambda: None
        if devices.has_window:
            from gamepad_client.picture import Picture

            picture = Picture()
            self._show = lambda status: devices.show(picture.draw(status))
        elif terminal:
            from rich.console import Console

            from gamepad_client.table import LiveTable

            console = Console()
            table = LiveTable(console)
            table.__enter__()
            self._every, self._show = _TABLE_EVERY, table.show
            self._close = lambda: table.__exit__(None, None, None)
            self.say = lambda line: console.print(line, markup=False, highlight=False)

    def show(self, status: Callable[[], Status], now: float) -> None:
        """Show a status, where it is time.

        Args:
            status: Gives it.
            now: Time [s], monotonic.
        """
        if self._show is not None and now - self._shown >= self._every:
            self._shown = now
            self._show(status())

    def close(self) -> None:
        """Leave the terminal as it was found."""
        self._close()
