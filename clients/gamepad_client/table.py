"""The terminal's view: a live table, redrawn by the loop itself a few times a second."""

from types import TracebackType
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from gamepad_client.status import Hand, Status
from ik_client.arm_joints import SIDES
from ik_client.state_machine import ArmState

_BAR = 20
STATE_COLOURS = {
    ArmState.DISARMED: "white",
    ArmState.ALIGNING: "yellow",
    ArmState.ACTIVE: "green",
    ArmState.HOLD: "yellow",
    ArmState.FAULT: "red",
}


class LiveTable:
    """Shows a status in place."""

    def __init__(self, console: Console) -> None:
        """Begin where the cursor is.

        Args:
            console: The terminal.
        """
        self._live = Live(console=console, auto_refresh=False, transient=True)

    def show(self, status: Status) -> None:
        """Redraw."""
        self._live.update(render(status), refresh=True)

    def __enter__(self) -> Self:
        """Begin."""
        self._live.start(refresh=False)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take the view away."""
        self._live.stop()


def render(status: Status) -> Group:
    """The view of a status."""
    head = Text.assemble(
        (f"{status.state:<9}", f"bold {STATE_COLOURS[status.state]}"),
        "going home  " if status.homing else "",
        (status.reason or ("" if status.state is ArmState.ACTIVE else status.hint), "dim"),
    )
    table = Table(box=None, padding=(0, 2, 0, 0))
    columns = ("", "asked x y z [m/s]", "comes of it", "turn [rad/s]", "manipulability", "slowed by")
    for name in columns:
        table.add_column(Text(name), justify="left", header_style="dim", no_wrap=True)
    for side, hand in zip(SIDES, status.hands, strict=True):
        achieved = "" if hand.achieved is None else _numbers(hand.achieved[:3])
        table.add_row(side, _numbers(hand.asked[:3]), achieved, _numbers(hand.asked[3:]), _bar(hand), hand.limit)
    foot = Text(f"{status.device}   axes of the {status.frame}   {status.speed:.2f} m/s   {status.hint}", style="dim")
    return Group(head, table, foot)


def _numbers(vector) -> str:
    return " ".join(f"{value + 0.0:+.2f}" for value in vector)


def _bar(hand: Hand) -> Text:
    if hand.manipulability is None:
        return Text("unknown", style="dim")
    full = round(_BAR * hand.manipulability)
    colour = "yellow" if hand.damped else "green"
    return Text.assemble(("━" * full, colour), ("━" * (_BAR - full), "bright_black"))
