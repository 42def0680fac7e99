"""The operator at a pad or at the keyboard, as the rate loop's source: devices in, a wish out, once a tick.

Sticks move hands: forward is x, to the left is y, and up and down have buttons of their own. With `turn` held the same
controls turn the hands instead: forward tips them, left turns them left, up rolls them. With `lift` held a stick's
forward is up, so that each hand can be raised alone. Who has let go of the pad, or turned to another window, wants
nothing.
"""

import numpy as np

from gamepad_client.layout import KEY_HOLD, PAD_HOLD, Layout
from gamepad_client.shaping import Shaping
from ik_client.arm_joints import SIDES
from ik_client.devices import Devices, Pad, open_switch
from ik_client.rate_types import Wish
from ik_client.start import SettingsError
from ik_proto import Array, Frame

PACES = tuple(float(pace) for pace in np.round(np.geomspace(0.1, 2.0, 14), 3))
"""Factors on the speeds between which `faster` and `slower` go: a quarter more, or less, with each press."""

_FULL = int(np.argmin(np.abs(np.array(PACES) - 1.0)))


class Operator:
    """Reads devices; fits `WishSource`.

    Attributes:
        frame: Along whose axes the hands are moved.
        pad: The pad in use; None where there is none, or the keyboard is used.
        ended: Whether the operator wants to end it all: Escape, or the window was closed.
    """

    def __init__(
        self,
        devices: Devices,
        layout: Layout,
        *,
        keyboard: bool = False,
        speed: float = 0.3,
        turn_speed: float = 0.8,
        shaping: Shaping | None = None,
        frame: Frame = "pelvis",
    ) -> None:
        """Open the switch.

        Args:
            devices: Pads and keys.
            layout: Which control does what.
            keyboard: Whether keys do it, not a pad.
            speed: Of a hand, with the stick at its edge [m/s].
            turn_speed: The same of turning [rad/s].
            shaping: How sticks answer.
            frame: Along whose axes the hands are moved at the beginning.

        Raises:
            DeviceError: The hold-to-run switch cannot be opened.
            SettingsError: No keyboard has a key that the layout names.
        """
        self.frame: Frame = frame
        self.pad: Pad | None = None
        self.ended = False
        self._devices = devices
        self._layout = layout
        self._keyboard = keyboard
        self._speeds = (speed, turn_speed)
        self._shaping = shaping or Shaping()
        self._pace = _FULL
        self._down: frozenset[str] = frozenset()
        self.switch = open_switch(layout.hold or (KEY_HOLD if keyboard else PAD_HOLD), devices)
        unknown = [key for key in layout.keys.values() if keyboard and not devices.knows_key(key)]
        if unknown:
            raise SettingsError(f"there is no key {unknown[0]!r}: write its name as in a, left shift, tab or f1")

    @property
    def pace(self) -> float:
        """Factor on the speeds."""
        return PACES[self._pace] / PACES[_FULL]

    @property
    def speed(self) -> float:
        """Of a hand, with the stick at its edge [m/s]."""
        return self._speeds[0] * self.pace

    def wish(self, now: float) -> Wish:
        """Look at the devices.

        Args:
            now: Time [s].
        """
        self._devices.pump()
        there = self._find()
        held = self.switch.held if there else None
        down = self._actions()
        pressed, self._down = down - self._down, down
        self._press(pressed)
        directions = self._keys() if self._keyboard else self._sticks(lift="lift" in down)
        return Wish(
            self._twists(directions, turn="turn" in down),
            held,
            now,
            frame=self.frame,
            home="home" in down,
            stop="stop" in down,
        )

    def _find(self) -> bool:
        """Whether the device that moves the hands is there."""
        if self._keyboard:
            return not self._devices.closed
        if self.pad is not None and not self.pad.connected:
            self.pad, self._down = None, frozenset()
            return False  # For a tick at least, also where another pad is there: it must be taken up anew.
        if self.pad is None and self._devices.pads:
            self.pad = self._devices.pads[0]
        return self.pad is not None

    def _actions(self) -> frozenset[str]:
        """Actions whose buttons or keys are down, or went down since the tick before."""
        keys = self._devices.keys | self._devices.pressed
        if self._keyboard:
            return frozenset(action for action, key in self._layout.keys.items() if key in keys)
        pad = self.pad
        if pad is None:
            return frozenset()
        buttons = self._layout.buttons.items()
        return frozenset(action for action, names in buttons if any(pad.button(name) for name in names))

    def _press(self, pressed: frozenset[str]) -> None:
        """What happens once with each press."""
        if "frame" in pressed:
            self.frame = "hand" if self.frame == "pelvis" else "pelvis"
        self._pace += ("faster" in pressed) - ("slower" in pressed)
        self._pace = min(max(self._pace, 0), len(PACES) - 1)
        keys = self._devices.keys | self._devices.pressed
        self.ended |= self._devices.closed or (self._devices.has_window and self._layout.keys["end"] in keys)

    def _sticks(self, *, lift: bool) -> Array:
        """Forward, left and up of each hand, shape (2, 3), each within the unit ball."""
        pad = self.pad
        if pad is None:
            return np.zeros((2, 3))
        pulled = {
            action: max(self._shaping.pull(_pulled(pad, name)) for name in self._layout.buttons[action])
            for action in ("up", "down")
        }
        rows = []
        for side in SIDES:
            axes = (self._layout.sticks[f"{side}_{way}"] for way in ("forward", "left"))
            forward, left = self._shaping.stick(*(_axis(pad, axis) for axis in axes))
            up = pulled["up"] - pulled["down"]
            rows.append((0.0, left, up + forward) if lift else (forward, left, up))
        return _within(np.array(rows))

    def _keys(self) -> Array:
        """The same from keys."""
        held, keys = self._devices.keys, self._layout.keys

        def way(side: str, one: str, other: str) -> float:
            return float(keys[f"{side}_{one}"] in held) - float(keys[f"{side}_{other}"] in held)

        pairs = (("forward", "back"), ("left", "right"), ("up", "down"))
        return _within(np.array([[way(side, *pair) for pair in pairs] for side in SIDES]))

    def _twists(self, directions: Array, *, turn: bool) -> Array:
        twists = np.zeros((2, 6))
        if not turn:
            twists[:, :3] = directions * self._speeds[0] * self.pace
        else:  # Forward tips about y, left turns about z, up rolls about x.
            twists[:, 3:] = directions[:, [2, 0, 1]] * self._speeds[1] * self.pace
        return twists


def _axis(pad: Pad, axis: str) -> float:
    return -pad.axis(axis[1:]) if axis.startswith("-") else pad.axis(axis)


def _pulled(pad: Pad, name: str) -> float:
    return pad.axis(name) if name.endswith("_trigger") else float(pad.button(name))


def _within(directions: Array) -> Array:
    """Rows no longer than 1: the speed of a hand is the same in every direction."""
    return directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1.0)
