"""The same as in the preview as a table in a terminal, for a machine without a display."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.table import Table

from camera_client.board import Shown
from ik_client.arm_joints import SIDES

_SWITCH = {True: "held", False: "open", None: "not known"}


class Terminal:
    """A table that is kept up to date, and lines above it."""

    def __init__(self, console: Console) -> None:
        """Start empty.

        Args:
            console: The terminal.
        """
        self._live = Live(console=console, auto_refresh=False, transient=True)

    def __enter__(self) -> Self:
        """Take the terminal's last lines."""
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give them back."""
        self._live.stop()

    def say(self, line: str) -> None:
        """Print a line above the table."""
        self._live.console.print(line, markup=False, highlight=False)

    def show(self, shown: Shown) -> None:
        """Bring the table up to date."""
        self._live.update(table(shown), refresh=True)


def table(shown: Shown) -> Table:
    """What is shown, as a table."""
    out = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    out.add_row("switch", _SWITCH[shown.switch])
    for side, words in zip(SIDES, shown.arms, strict=True):
        out.add_row(f"{side} arm", words)
    out.add_row("operator", shown.operator)
    latencies = "  ".join(f"{name} {ms:.1f}" for name, ms in shown.latency_ms.items() if ms is not None)
    out.add_row("ms", latencies or "-")
    out.add_row("", shown.trouble)
    return out
