"""A pad that is not there: SDL's own virtual joystick, so that it comes and goes as a real one does.

SDL's library is the one that pygame has loaded; `Devices` has to exist first. Axes and buttons are in the order of
`ik_client.devices.AXES` and `BUTTONS`.
"""

import ctypes
from pathlib import Path

from ik_client.devices import AXES, BUTTONS

_GAMECONTROLLER = 1


class VirtualPad:
    """Plugged in from the beginning."""

    def __init__(self) -> None:
        self._sdl = _library()
        self.plug()

    def plug(self) -> None:
        index = self._sdl.SDL_JoystickAttachVirtual(_GAMECONTROLLER, len(AXES), len(BUTTONS), 0)
        assert index >= 0, "SDL has no virtual joysticks"
        self._id = self._sdl.SDL_JoystickGetDeviceInstanceID(index)
        self._handle = self._sdl.SDL_JoystickOpen(index)

    def unplug(self) -> None:
        self._sdl.SDL_JoystickClose(self._handle)
        count = self._sdl.SDL_NumJoysticks()
        (index,) = (k for k in range(count) if self._sdl.SDL_JoystickGetDeviceInstanceID(k) == self._id)
        assert self._sdl.SDL_JoystickDetachVirtual(index) == 0

    def axis(self, name: str, value: float) -> None:
        """Move an axis: -1 to 1; a trigger, 0 to 1."""
        raw = 65535.0 * value - 32768.0 if "trigger" in name else 32767.0 * value
        assert self._sdl.SDL_JoystickSetVirtualAxis(self._handle, AXES.index(name), round(raw)) == 0

    def button(self, name: str, held: bool) -> None:
        assert self._sdl.SDL_JoystickSetVirtualButton(self._handle, BUTTONS.index(name), held) == 0

    def rest(self) -> None:
        for name in AXES:
            self.axis(name, 0.0)
        for name in BUTTONS:
            self.button(name, False)


def _library() -> ctypes.CDLL:
    maps = Path("/proc/self/maps").read_text().splitlines()
    (path,) = {line.split()[-1] for line in maps if Path(line.split()[-1]).name.startswith("libSDL2-2")}
    sdl = ctypes.CDLL(path)
    sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
    sdl.SDL_JoystickClose.argtypes = [ctypes.c_void_p]
    sdl.SDL_JoystickSetVirtualAxis.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int16]
    sdl.SDL_JoystickSetVirtualButton.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8]
    return sdl
