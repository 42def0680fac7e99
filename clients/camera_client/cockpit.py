"""What the operator has in hand and before them: switches, keys, a window or a terminal. All in the main thread.

SDL wants the main thread: on some systems windows and their events belong to it. So the teleop loop has a thread of its
own, and a window that is dragged, or a picture that takes long, never keeps a command from the robot. The switch is
read here, and readings grow old: see `enable`.
"""

import contextlib
import time
from collections.abc import Callable, Sequence

from rich.console import Console

from camera_client.board import Shown
from camera_client.enable import Enable
from camera_client.preview import SIZE, Preview
from camera_client.terminal import Terminal
from ik_client.devices import DeviceError, Devices, open_switch
from ik_client.start import SettingsError

DEFAULT_SWITCH = "key:space"
_PICTURES_PER_S = 12.0
_RELEASE_KEY, _END_KEY = "l", "escape"


class Cockpit:
    """Devices and displays of a run.

    Attributes:
        enable: The hold-to-run switch; None where a recording brings its own.
        ended: Whether the operator has closed the window, or pressed Escape.
        has_window: Whether there is a window.
    """

    def __init__(
        self,
        switches: Sequence[str],
        *,
        own_switch: bool,
        window: bool,
        title: str,
        terminal: bool,
        watch: Callable[[Shown], None] | None = None,
    ) -> None:
        """Open devices and displays; close it.

        Args:
            switches: As `open_switch` takes them; empty for the default one.
            own_switch: Whether a recording brings a switch, so that none is needed.
            window: Whether a window is wanted, where there is a display.
            title: Of the window.
            terminal: Whether the output is a terminal.
            watch: Shows everything too.

        Raises:
            DeviceError: A switch cannot be used.
            SettingsError: There is no window for the default switch.
        """
        self.ended = False
        self._stack = contextlib.ExitStack()
        self._next = 0.0
        self._watch = watch
        self._preview: Preview | None = None
        self._terminal: Terminal | None = None
        self._devices: Devices | None = None
        wanted = tuple(switches) or (() if own_switch else (DEFAULT_SWITCH,))
        if window or wanted:
            self._devices = self._open(wanted, window, title, asked=bool(switches))
        self.has_window = self._devices is not None and self._devices.has_window
        self.enable: Enable | None = None
        if wanted:
            assert self._devices is not None
            opened = [open_switch(spec, self._devices) for spec in wanted]
            for switch in opened:
                if (close := getattr(switch, "close", None)) is not None:
                    self._stack.callback(close)
            self.enable = Enable(opened)
        self.hint = self._hint(wanted)
        if self.has_window:
            self._preview = Preview()
        elif terminal:
            self._terminal = self._stack.enter_context(Terminal(Console()))

    def _open(self, wanted: tuple[str, ...], window: bool, title: str, asked: bool) -> Devices:
        needs_window = any(spec.startswith("key:") for spec in wanted)
        if window:
            try:
                return self._stack.enter_context(Devices(SIZE, title))
            except DeviceError as error:
                if needs_window:
                    other = "--enable pad:right_shoulder or --enable pedal:/dev/input/..."
                    raise SettingsError(
                        f"a key as the hold-to-run switch needs a window: {error}; or {other}"
                    ) from None
        elif needs_window and not asked:
            raise SettingsError(
                "--no-preview leaves no window for the space bar as the hold-to-run switch: give another with --enable"
            )
        return self._stack.enter_context(Devices(None, title))

    def _hint(self, wanted: tuple[str, ...]) -> str:
        hold = f"hold {' or '.join(wanted)}; " if wanted else ""
        return f"{hold}{_RELEASE_KEY.upper()}: next operator; Esc: end"

    def attend(self, now: float) -> bool:
        """Read switches and keys.

        Args:
            now: The time [s], the loop's clock.

        Returns:
            Whether the operator is to be released.
        """
        release = False
        if self._devices is not None:
            self._devices.pump()
            release = _RELEASE_KEY in self._devices.pressed
            self.ended |= self._devices.closed or _END_KEY in self._devices.pressed
        if self.enable is not None:
            self.enable.read(now)
        return release

    def show(self, look: Callable[[], Shown], now: float) -> None:
        """Show how things are, as often as is worth it.

        Args:
            look: Says how they are.
            now: The time [s].
        """
        if now < self._next:
            return
        self._next = now + 1.0 / _PICTURES_PER_S
        if self._preview is not None and self._devices is not None:
            self._devices.show(self._preview.draw(look(), self.hint))
        elif self._terminal is not None:
            self._terminal.show(look())
        if self._watch is not None:
            self._watch(look())

    def say(self, line: str) -> None:
        """Tell the person at the terminal a line."""
        if self._terminal is not None:
            self._terminal.say(line)
        else:
            print(line, flush=True)

    def close(self) -> None:
        """Give everything back."""
        self._stack.close()

    def __enter__(self) -> "Cockpit":
        """Use it in a `with` block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Give everything back."""
        self.close()


def pause() -> None:
    """Wait until the switch is worth another look."""
    time.sleep(0.008)
