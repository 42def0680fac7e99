"""A gamepad, by the positions of its controls: what SDL's mapping database makes of any pad it knows.

A position has the same name on every pad, whatever is printed there: `south` is cross on PlayStation and A on Xbox. The
printed names are understood too. Axes are SDL's: x to the right, y to the operator, so a stick pushed forward has a
negative y; triggers go from 0 to 1.

A pad that is gone is at rest: its axes are 0 and its buttons open.
"""

from typing import TYPE_CHECKING

from ik_client.devices.errors import DeviceError

if TYPE_CHECKING:
    from pygame._sdl2.controller import Controller
    from pygame.joystick import JoystickType

AXES = ("left_stick_x", "left_stick_y", "right_stick_x", "right_stick_y", "left_trigger", "right_trigger")
"""Names of axes, in SDL's order (SDL_GameControllerAxis)."""

BUTTONS = (
    "south",
    "east",
    "west",
    "north",
    "back",
    "guide",
    "start",
    "left_stick",
    "right_stick",
    "left_shoulder",
    "right_shoulder",
    "dpad_up",
    "dpad_down",
    "dpad_left",
    "dpad_right",
)
"""Names of buttons, in SDL's order (SDL_GameControllerButton)."""

ALIASES = {
    "a": "south",
    "b": "east",
    "x": "west",
    "y": "north",
    "cross": "south",
    "circle": "east",
    "square": "west",
    "triangle": "north",
    "share": "back",
    "create": "back",
    "view": "back",
    "options": "start",
    "menu": "start",
    "l1": "left_shoulder",
    "r1": "right_shoulder",
    "lb": "left_shoulder",
    "rb": "right_shoulder",
    "l2": "left_trigger",
    "r2": "right_trigger",
    "lt": "left_trigger",
    "rt": "right_trigger",
    "l3": "left_stick",
    "r3": "right_stick",
}
"""What is printed on pads, and the position it is at."""

_FULL = 32767
_TRIGGER_HELD = 0.5
"""Way of a trigger beyond which it counts as a button that is held."""


def axis_name(name: str) -> str:
    """The position of an axis.

    Raises:
        DeviceError: No pad has it.
    """
    position = ALIASES.get(name, name)
    if position not in AXES:
        raise DeviceError(f"a pad has no axis {name!r}: choose one of {', '.join(AXES)}")
    return position


def button_name(name: str) -> str:
    """The position of a button, or of a trigger that is used as one.

    Raises:
        DeviceError: No pad has it.
    """
    position = ALIASES.get(name, name)
    if position not in BUTTONS and position not in AXES[4:]:
        raise DeviceError(f"a pad has no button {name!r}: choose one of {', '.join(BUTTONS + AXES[4:])}")
    return position


class Pad:
    """One pad, from when it is plugged in until it is gone. A pad that comes back is another one.

    Attributes:
        name: What it calls itself.
        id: Its number; none is used twice in a run.
        connected: Whether it is there.
    """

    def __init__(self, controller: "Controller", joystick: "JoystickType") -> None:
        """Take it over.

        Args:
            controller: SDL's, opened for this pad alone.
            joystick: The same device without names of positions, which knows its number.
        """
        self._controller = controller
        self._joystick = joystick
        self.name: str = controller.name
        self.id: int = joystick.get_instance_id()
        self.connected = True

    def look(self) -> bool:
        """Find out whether it is still there, and say so."""
        if self.connected and not self._controller.attached():
            self.close()
        return self.connected

    def axis(self, name: str) -> float:
        """Where an axis is, -1 to 1; a trigger, 0 to 1.

        Raises:
            DeviceError: No pad has an axis of this name.
        """
        number = AXES.index(axis_name(name))
        return max(-1.0, self._controller.get_axis(number) / _FULL) if self.connected else 0.0

    def button(self, name: str) -> bool:
        """Whether a button is held, or a trigger pulled more than half.

        Raises:
            DeviceError: No pad has a button of this name.
        """
        position = button_name(name)
        if position in AXES:
            return self.axis(position) > _TRIGGER_HELD
        return self.connected and bool(self._controller.get_button(BUTTONS.index(position)))

    def close(self) -> None:
        """Let go of it; from now on it is at rest."""
        self.connected = False
        self._controller.quit()
        self._joystick.quit()
