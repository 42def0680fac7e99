"""The end of a client's run: the arms are disarmed, and led until they rest.

A loop that stopped at its first tick of braking would leave the rest to the robot's end, which knows no dynamics: the
arms would hang by the torque of another posture, beside where they are held. Led to rest, they are held with their own.
"""

from collections.abc import Callable
from typing import Protocol

from ik_client.pacer import Pacer

LONGEST = 0.5
"""How long the arms are led after they were disarmed [s]: they come to rest from any motion, and to spare."""


class Ending(Protocol):
    """A loop, as far as it matters to its end."""

    @property
    def rests(self) -> bool:
        """Whether the last tick changed nothing of the command."""
        ...

    def stop(self, reason: str = ...) -> None:
        """Disarm."""
        ...


def come_to_rest(loop: Ending, reason: str, tick: Callable[[], object], pacer: Pacer) -> None:
    """Disarm, and tick until the arms rest.

    Args:
        loop: The loop.
        reason: Why it ends, in one line.
        tick: Does a tick of it; the first follows at once.
        pacer: Keeps the schedule.
    """
    loop.stop(reason)
    tick()
    for _ in range(round(LONGEST / pacer.period)):
        if loop.rests:
            return
        pacer.wait()
        tick()
