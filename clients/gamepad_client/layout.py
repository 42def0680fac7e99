"""Which control does what: the default layout, and mapping files for others.

A mapping file is TOML. What it leaves out stays as it is by default:

    hold = "pad:left_shoulder"          # any switch: also key:NAME, pedal:/dev/input/eventN

    [sticks]                            # an axis each; a minus turns it round
    left_forward = "-left_stick_y"
    left_left = "-left_stick_x"

    [buttons]                           # one or several buttons or triggers
    up = ["dpad_up", "right_trigger"]
    home = "west"

    [keys]                              # of --keyboard
    left_forward = "w"
"""

import tomllib
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ik_client.devices import DeviceError
from ik_client.devices.pad import axis_name, button_name
from ik_client.start import SettingsError

STICKS = {
    "left_forward": "-left_stick_y",
    "left_left": "-left_stick_x",
    "right_forward": "-right_stick_y",
    "right_left": "-right_stick_x",
}
"""What sticks do, and which axes do it by default."""

BUTTONS = {
    "up": ("dpad_up", "right_trigger"),
    "down": ("dpad_down", "left_trigger"),
    "lift": ("south",),
    "turn": ("right_shoulder",),
    "frame": ("north",),
    "home": ("west",),
    "stop": ("east",),
    "faster": ("dpad_right",),
    "slower": ("dpad_left",),
}
"""What buttons do, and which do it by default."""

KEYS = {
    "left_forward": "w",
    "left_back": "s",
    "left_left": "a",
    "left_right": "d",
    "left_up": "r",
    "left_down": "f",
    "right_forward": "i",
    "right_back": "k",
    "right_left": "j",
    "right_right": "l",
    "right_up": "y",
    "right_down": "h",
    "turn": "left shift",
    "frame": "tab",
    "home": "g",
    "stop": "x",
    "faster": "=",
    "slower": "-",
    "end": "escape",
}
"""What keys do, and which do it by default."""

PAD_HOLD, KEY_HOLD = "pad:left_shoulder", "key:space"


@dataclass(frozen=True, slots=True)
class Layout:
    """Which control does what.

    Attributes:
        hold: The hold-to-run switch, as `open_switch` takes it; empty for the default of pad or keyboard.
        sticks: Axis of each direction, with a minus where it is turned round.
        buttons: Buttons of each action.
        keys: Key of each direction and action.
    """

    hold: str = ""
    sticks: dict[str, str] = field(default_factory=lambda: dict(STICKS))
    buttons: dict[str, tuple[str, ...]] = field(default_factory=lambda: dict(BUTTONS))
    keys: dict[str, str] = field(default_factory=lambda: dict(KEYS))

    def __post_init__(self) -> None:
        """Check that no button does two things at once.

        Raises:
            SettingsError: One does.
        """
        kind, _, held = (self.hold or PAD_HOLD).partition(":")
        buttons = [(button_name(held), "hold")] if kind == "pad" else []
        buttons += [(button_name(name), action) for action, names in self.buttons.items() for name in names]
        kind, _, held = (self.hold or KEY_HOLD).partition(":")
        keys = [(held, "hold")] if kind == "key" else []
        keys += [(key, action) for action, key in self.keys.items()]
        for words, pairs in (("button", buttons), ("key", keys)):
            seen: dict[str, str] = {}
            for name, action in pairs:
                if name in seen:
                    raise SettingsError(f"{words} {name!r} is to do both {seen[name]!r} and {action!r}: give it one")
                seen[name] = action


def read_layout(path: Path) -> Layout:
    """Read a mapping file.

    Args:
        path: The file.

    Raises:
        SettingsError: It cannot be read, or something in it is no mapping; one line that says what.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(f"{path} cannot be read: {error.strerror}") from None
    except ValueError as error:  # no TOML, or no text
        raise SettingsError(f"{path} is no mapping file in TOML: {error}") from None
    try:
        return _layout(document)
    except ValueError as error:
        raise SettingsError(f"{path}: {error}") from None


def _layout(document: dict[str, Any]) -> Layout:
    _known(document, [part.name for part in fields(Layout)], "a mapping file has no")
    hold = document.get("hold", "")
    if not isinstance(hold, str):
        raise SettingsError("hold must be a switch in quotes, such as 'pad:left_shoulder'")
    sticks, buttons, keys = (_table(document, name) for name in ("sticks", "buttons", "keys"))
    _known(sticks, STICKS, "[sticks] has no")
    _known(buttons, BUTTONS, "[buttons] has no")
    _known(keys, KEYS, "[keys] has no")
    for action, axis in sticks.items():
        try:
            axis_name(axis.removeprefix("-"))
        except (AttributeError, DeviceError) as error:
            raise SettingsError(f"[sticks] {action}: {_words(error, 'an axis')}") from None
    named: dict[str, tuple[str, ...]] = {}
    for action, names in buttons.items():
        try:
            listed = [names] if isinstance(names, str) else names
            named[action] = tuple(button_name(name) for name in listed)
        except (TypeError, DeviceError) as error:
            raise SettingsError(f"[buttons] {action}: {_words(error, 'a button or a list of them')}") from None
    for action, key in keys.items():
        if not isinstance(key, str) or not key:
            raise SettingsError(f"[keys] {action}: {_words(TypeError(), 'a key')}")
    return Layout(hold, STICKS | sticks, BUTTONS | named, KEYS | keys)


def _table(document: dict[str, Any], name: str) -> dict[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise SettingsError(f"{name} must be a table: [{name}]")
    return table


def _known(table: dict[str, Any], names: Any, words: str) -> None:
    for name in table:
        if name not in names:
            raise SettingsError(f"{words} {name!r}: choose of {', '.join(names)}")


def _words(error: Exception, what: str) -> str:
    return str(error) if isinstance(error, DeviceError) else f"write the name of {what} in quotes"
