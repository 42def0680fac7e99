"""A foot pedal that is a keyboard to the system, read past all windows through Linux's input devices (evdev).

Held while any of its keys is. It is not taken away from other programs, so they see its keys too. One that was
unplugged is looked for again at the same path; another device that turns up there instead is not taken for it.
"""

import time
from collections.abc import Callable
from typing import Any

from ik_client.devices.errors import DeviceError

_LOOK_EVERY = 0.5
"""Pause between two looks for a pedal that is gone [s]."""

_DROPPED = 3
"""Code of the event that says that events were lost (SYN_DROPPED)."""


class Pedal:
    """One input device; fits `Switch`."""

    def __init__(self, path: str, clock: Callable[[], float] = time.monotonic) -> None:
        """Open it.

        Args:
            path: Its file, such as /dev/input/by-id/usb-...-event-kbd.
            clock: Monotonic time [s].

        Raises:
            DeviceError: It is not there, is no device with keys, or may not be read.
        """
        try:
            import evdev
        except ImportError:
            raise DeviceError("a pedal needs Linux and package evdev: pip install 'ik-service[gamepad]'") from None
        self._open: Callable[[str], Any] = evdev.InputDevice
        self._key_type, self._sync_type = evdev.ecodes.EV_KEY, evdev.ecodes.EV_SYN
        self._path = path
        self._clock = clock
        self._looked = -float("inf")
        try:
            self._device: Any = self._open(path)
        except PermissionError:
            raise DeviceError(f"pedal {path} may not be read: sudo usermod -aG input $USER, then log in anew") from None
        except OSError as error:
            seen = ", ".join(evdev.list_devices()) or "none that may be read"
            reason = error.strerror or "it is no input device"
            raise DeviceError(f"pedal {path}: {reason}; input devices here: {seen}") from None
        if self._key_type not in self._device.capabilities():
            self._device.close()
            raise DeviceError(f"pedal {path}: {self._device.name} has no keys")
        self._identity = self._who(self._device)
        self._keys = set(self._device.active_keys())

    @property
    def held(self) -> bool | None:
        """Whether a key of it is held; None where it is gone."""
        if self._device is None and not self._find():
            return None
        try:
            self._read()
        except OSError:
            self._device.close()
            self._device = None
            return None
        return bool(self._keys)

    def close(self) -> None:
        """Let go of it."""
        if self._device is not None:
            self._device.close()
            self._device = None
        self._looked = float("inf")

    def _read(self) -> None:
        try:
            for event in self._device.read():
                if event.type == self._sync_type and event.code == _DROPPED:
                    self._keys = set(self._device.active_keys())
                elif event.type == self._key_type:
                    (self._keys.add if event.value else self._keys.discard)(event.code)
        except BlockingIOError:
            pass  # Nothing has happened.

    def _find(self) -> bool:
        """Whether the pedal is there again."""
        now = self._clock()
        if now - self._looked < _LOOK_EVERY:
            return False
        self._looked = now
        try:
            device = self._open(self._path)
        except OSError:
            return False
        if self._who(device) != self._identity:
            device.close()
            return False
        self._device, self._keys = device, set(device.active_keys())
        return True

    @staticmethod
    def _who(device: Any) -> tuple[str, Any]:
        return device.name, device.info
