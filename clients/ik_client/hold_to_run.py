"""The hold-to-run switch: the operator's grip, and what counts as a deliberate press.

- A press is a tick in which the switch is open, followed by one in which it is held, with a hand that can be followed.
  So a switch that is held at the start, or when a link comes back, arms nothing: it must be let go first.
- A press while the hand cannot be followed is void, also when the hand comes back: it must be let go first.
- Where the tracker cannot tell, a held switch stays held: whoever follows must hold in that tick, and may go on when it
  is still held afterwards. An open one counts as unknown, because a press during the gap was not seen.

A grip button is not a certified enabling device.
"""

from enum import StrEnum


class Grip(StrEnum):
    """What the operator does with the switch."""

    RELEASED = "released"
    PRESSED = "pressed"
    HELD = "held"


class HoldToRun:
    """Finds deliberate presses. One per hand, one update per tick."""

    def __init__(self) -> None:
        """Start locked: the switch has to be seen open before a press counts."""
        self._open = False
        self._held = False

    def update(self, held: bool | None, followable: bool) -> Grip:
        """Take the switch of this tick.

        Args:
            held: Whether it is held; None where the tracker cannot tell.
            followable: Whether the hand can be followed in this tick.

        Returns:
            PRESSED in the tick of a deliberate press, HELD from then on until it is let go, else RELEASED.
        """
        pressed = bool(held) and self._open and followable
        if held is not None:
            self._held = bool(held) and (self._held or pressed)
        self._open = held is not None and not held
        if pressed:
            return Grip.PRESSED
        return Grip.HELD if self._held else Grip.RELEASED
