"""The hold-to-run switch as a key, a button of a pad, or a pedal.

| spec                        | the switch                                                              |
|-----------------------------|-------------------------------------------------------------------------|
| `key:space`                 | a key of our window, while it has the focus                             |
| `pad:left_shoulder`         | a button of the first pad, by its position or by what is printed there  |
| `pedal:/dev/input/event5`   | any key of an input device, whatever window is in front                 |

None of them is a certified enabling device. Whoever follows must hold where the switch is None.
"""

from typing import Protocol

from ik_client.devices.errors import DeviceError
from ik_client.devices.pad import Pad, button_name
from ik_client.devices.pedal import Pedal
from ik_client.devices.sdl import Devices

_WAYS = "key:NAME as in key:space, pad:BUTTON as in pad:left_shoulder, or pedal:/dev/input/eventN"


class Switch(Protocol):
    """Held, open, or not there."""

    @property
    def held(self) -> bool | None:
        """Whether it is held; None where the device is not there, or gone."""
        ...


def open_switch(spec: str, devices: Devices) -> Switch:
    """Make a switch.

    Args:
        spec: Which, as in the table above.
        devices: Where keys and pads come from.

    Raises:
        DeviceError: There is no such switch; one line that says what can be written.
    """
    kind, _, name = spec.partition(":")
    if not name or kind not in ("key", "pad", "pedal"):
        raise DeviceError(f"{spec!r} is no switch: write {_WAYS}")
    if kind == "pad":
        return _Button(devices, button_name(name))
    if kind == "pedal":
        return Pedal(name)
    if not devices.has_window:
        raise DeviceError(f"{spec} needs a window of ours to have the keyboard: write {_WAYS.partition(', ')[2]}")
    if not devices.knows_key(name):
        raise DeviceError(f"there is no key {name!r}: write its name as in key:space, key:a, key:left shift or key:f1")
    return _Key(devices, name)


class _Key:
    def __init__(self, devices: Devices, name: str) -> None:
        self._devices = devices
        self._name = name

    @property
    def held(self) -> bool | None:
        return None if self._devices.closed else self._name in self._devices.keys


class _Button:
    """A button of one pad; of another one only after a tick in which there was none."""

    def __init__(self, devices: Devices, name: str) -> None:
        self._devices = devices
        self._name = name
        self._pad: Pad | None = None
        self._gone = -1

    @property
    def held(self) -> bool | None:
        if self._pad is not None and not self._pad.connected:
            self._pad, self._gone = None, self._devices.pumps
        if self._pad is None and self._devices.pads and self._gone != self._devices.pumps:
            self._pad = self._devices.pads[0]
        return None if self._pad is None else self._pad.button(self._name)
