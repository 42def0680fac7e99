"""The hold-to-run switch of both arms: any of a few devices, read in one thread and asked for in another.

- It is held while any of its devices is. Where none is, and one cannot tell, it is not known.
- A reading is good for `FRESH`. Who reads the devices may be kept up, by a window that is dragged or by a disk; then
  the switch is not known either, and whoever follows must hold. It is not held for ever because nobody looked.
"""

from collections.abc import Sequence
from typing import Protocol

FRESH = 0.15
"""How long a reading counts [s]."""


class Held(Protocol):
    """One device."""

    @property
    def held(self) -> bool | None:
        """Whether it is held; None where it cannot tell."""
        ...


class Enable:
    """The last reading of the devices."""

    def __init__(self, switches: Sequence[Held]) -> None:
        """Start without a reading.

        Args:
            switches: The devices.
        """
        self._switches = switches
        self._reading: tuple[bool | None, float] = (None, float("-inf"))

    def read(self, now: float) -> None:
        """Look at the devices.

        Args:
            now: The time [s], monotonic, the loop's clock.
        """
        states = [switch.held for switch in self._switches]
        held = True if True in states else None if None in states or not states else False
        self._reading = held, now

    def held(self, now: float) -> bool | None:
        """Whether the switch is held; None where that is not known.

        Args:
            now: The time [s].
        """
        held, when = self._reading
        return held if 0.0 <= now - when <= FRESH else None
