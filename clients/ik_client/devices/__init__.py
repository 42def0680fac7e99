"""What an operator holds: pads, keys of our own window, foot pedals. Extra `gamepad`.

`Devices` owns SDL and is used from one thread; `open_switch` makes a hold-to-run switch of any of them. SDL is loaded
when `Devices` is made, evdev when a pedal is opened; importing this loads neither.
"""

from ik_client.devices.errors import DeviceError
from ik_client.devices.pad import AXES, BUTTONS, Pad
from ik_client.devices.sdl import Devices
from ik_client.devices.switch import Switch, open_switch

__all__ = ["AXES", "BUTTONS", "DeviceError", "Devices", "Pad", "Switch", "open_switch"]
