"""Pads and keys through SDL, which is owned here: one `Devices` per process, used from one thread.

- Pads are heard whatever window is in front. Keys are those of our own window, and only while it has the focus: who
  turns to another window has let go of all of them.
- Without a window SDL's dummy driver stands in: it needs no display, and has no keys.
"""

import contextlib
import os
import sys
from collections.abc import Generator
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any, Self

from numpy.typing import NDArray

from ik_client.devices.errors import DeviceError
from ik_client.devices.pad import Pad

_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")


class Devices:
    """All that is plugged in, and our window.

    Attributes:
        pads: The pads that are connected, in the order in which they came.
        keys: Names of the keys that are held in our window; none without its focus.
        pressed: Names of the keys that went down since the pump before.
        closed: Whether our window was closed.
        pumps: How often `pump` was called.
        has_window: Whether there is a window.
    """

    def __init__(self, window: tuple[int, int] | None = None, title: str = "", mappings: Path | None = None) -> None:
        """Load SDL, and open a window where one is wanted.

        Args:
            window: Width and height of the window [pixels]; None for none.
            title: Its title.
            mappings: File with mappings of pads that SDL does not know, a line each (SDL_GAMECONTROLLERCONFIG).

        Raises:
            DeviceError: SDL is not installed, there is no display for a window, or the mappings cannot be read.
        """
        self.pads: tuple[Pad, ...] = ()
        self.keys: frozenset[str] = frozenset()
        self.pressed: frozenset[str] = frozenset()
        self.closed = False
        self.pumps = 0
        self.has_window = window is not None
        self._pygame, self._controller = _load(mappings)
        self._screen: Any = None
        self._count = 0
        try:
            self._begin(window, title)
        except self._pygame.error as error:
            self._pygame.quit()
            where = "no display for a window" if self.has_window else "SDL does not start"
            raise DeviceError(f"{where} ({error})") from None

    def pump(self) -> None:
        """Take what has happened since the last call; once a tick."""
        pygame, held, pressed = self._pygame, set(self.keys), set()
        self.pumps += 1
        for event in pygame.event.get():
            match event.type:
                case pygame.KEYDOWN:
                    name = pygame.key.name(event.key)
                    pressed |= {name} - held
                    held.add(name)
                case pygame.KEYUP:
                    held.discard(pygame.key.name(event.key))
                case pygame.WINDOWFOCUSLOST | pygame.WINDOWMINIMIZED | pygame.WINDOWHIDDEN:
                    held.clear()
                case pygame.QUIT | pygame.WINDOWCLOSE:
                    held.clear()
                    self.closed = True
        self.keys, self.pressed = frozenset(held), frozenset(pressed)
        self._look_at_pads()

    def knows_key(self, name: str) -> bool:
        """Whether a key has this name on any keyboard."""
        try:
            self._pygame.key.key_code(name)
        except ValueError:
            return False
        return True

    def show(self, picture: NDArray[Any]) -> None:
        """Show a picture in the window; nothing without one.

        Args:
            picture: RGB, shape (h, w, 3), uint8. It is scaled to the window where it has another size.
        """
        if self._screen is None:
            return
        height, width, _ = picture.shape
        image = self._pygame.image.frombuffer(picture.tobytes(), (width, height), "RGB")
        if image.get_size() != self._screen.get_size():
            image = self._pygame.transform.smoothscale(image, self._screen.get_size())
        self._screen.blit(image, (0, 0))
        self._pygame.display.flip()

    def close(self) -> None:
        """Let go of everything."""
        for pad in self.pads:
            pad.close()
        self.pads, self.keys, self.pressed, self._screen = (), frozenset(), frozenset(), None
        self._pygame.quit()

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let go of everything."""
        self.close()

    def _begin(self, window: tuple[int, int] | None, title: str) -> None:
        pygame = self._pygame
        # Without a display SDL would fall back to one that nobody sees, not without complaining.
        if window and sys.platform == "linux" and not os.environ.keys() & _DISPLAYS:
            raise pygame.error(f"none of {', '.join(_DISPLAYS)} is set")
        with _driver(None if window else "dummy"):
            pygame.display.init()
        if window is not None:
            pygame.display.set_caption(title)
            self._screen = pygame.display.set_mode(window, pygame.RESIZABLE)
            pygame.key.stop_text_input()  # Keys are controls here: an input method must not swallow them.
        pygame.joystick.init()
        self._controller.init()
        # A stick moves in hundreds of events a second; where it is, is asked once a tick.
        pygame.event.set_blocked([pygame.JOYAXISMOTION, pygame.CONTROLLERAXISMOTION, pygame.MOUSEMOTION])

    def _look_at_pads(self) -> None:
        """Notice which have gone and come. Not left to events: some are lost, and the index they tell may be old."""
        there, count = tuple(pad for pad in self.pads if pad.look()), self._pygame.joystick.get_count()
        changed, self.pads, self._count = (there, count) != (self.pads, self._count), there, count
        if changed:
            self._open_new_pads()

    def _open_new_pads(self) -> None:
        known = {pad.id for pad in self.pads}
        for index in range(self._pygame.joystick.get_count()):
            try:
                joystick = self._pygame.joystick.Joystick(index)
                if joystick.get_instance_id() in known or not self._controller.is_controller(index):
                    continue
                pad = Pad(self._controller.Controller(index), joystick)
            except self._pygame.error:
                continue  # It is gone already.
            self.pads = (*self.pads, pad)


@contextlib.contextmanager
def _driver(name: str | None) -> Generator[None]:
    """Have SDL show its windows by a driver of this name; None leaves the choice to it."""
    before = os.environ.get("SDL_VIDEODRIVER")
    if name is not None:
        os.environ["SDL_VIDEODRIVER"] = name
    try:
        yield
    finally:
        if name is not None:
            os.environ.pop("SDL_VIDEODRIVER")
        if before is not None:
            os.environ["SDL_VIDEODRIVER"] = before


def _load(mappings: Path | None) -> tuple[ModuleType, ModuleType]:
    """Import pygame and its game controllers, with SDL told how to behave."""
    os.environ |= {
        "PYGAME_HIDE_SUPPORT_PROMPT": "1",
        "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",
        # A position counts, not what is printed there.
        "SDL_GAMECONTROLLER_USE_BUTTON_LABELS": "0",
        # Ctrl-C is ours.
        "SDL_NO_SIGNAL_HANDLERS": "1",
    }
    if mappings is not None:
        os.environ["SDL_GAMECONTROLLERCONFIG"] = _read(mappings)
    try:
        import pygame
        from pygame._sdl2 import controller
    except ImportError:
        raise DeviceError("package pygame-ce is missing: pip install 'ik-service[gamepad]'") from None
    return pygame, controller


def _read(mappings: Path) -> str:
    try:
        text = mappings.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DeviceError(f"{mappings} cannot be read: {getattr(error, 'strerror', None) or 'it is no text'}") from None
    lines = [line.strip() for line in text.splitlines()]
    lines = [line for line in lines if line and not line.startswith("#")]
    for line in lines:
        if line.count(",") < 2 or not all(":" in part for part in line.rstrip(",").split(",")[2:]):
            raise DeviceError(f"{mappings}: {line[:40]!r} is no mapping; a line is GUID,NAME,a:b0,leftx:a0,...")
    return "\n".join(lines)
