"""The pads that are there, for `ik-gamepad --list`."""

import time
from collections.abc import Iterator
from pathlib import Path

from ik_client.devices import Devices

_LOOK = 0.5
"""How long to look [s]."""


def list_pads(mappings: Path | None = None) -> Iterator[str]:
    """A line for each pad, or what to do where there is none.

    Args:
        mappings: File with mappings for SDL.

    Raises:
        DeviceError: SDL or the mappings cannot be used.
    """
    with Devices(mappings=mappings) as devices:
        end = time.monotonic() + _LOOK
        while time.monotonic() < end:
            devices.pump()
            time.sleep(0.01)
        for number, pad in enumerate(devices.pads):
            yield f"{number}: {pad.name}{' (used)' if number == 0 else ''}"
        if not devices.pads:
            yield "no gamepad: plug one in. One that is there and not listed needs a mapping, see --pads"
            unreadable = [path for path in Path("/dev/input").glob("event*") if not _readable(path)]
            if unreadable:
                yield f"{len(unreadable)} input devices may not be read: sudo usermod -aG input $USER, then log in anew"


def _readable(path: Path) -> bool:
    try:
        with path.open("rb"):
            return True
    except OSError:
        return False
