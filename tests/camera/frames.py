"""Small frames for tests of sources, and a clock that only tests move."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camera_client.frame import Intrinsics, RgbdFrame

CAMERA = Intrinsics(30.0, 30.0, 15.5, 11.5)


def numbered(number: int, t_capture: float, depth: bool = False) -> RgbdFrame:
    """A grey frame that says its number, up to 255, by its colour."""
    colour = np.full((24, 32, 3), number, np.uint8)
    return RgbdFrame(t_capture, np.full((24, 32), 2000, np.uint16) if depth else None, CAMERA, colour)


def number_of(frame: RgbdFrame | None) -> int | None:
    """What `numbered` said; None of no frame."""
    if frame is None:
        return None
    assert frame.colour is not None
    return round(float(frame.colour.mean()))


@dataclass
class Clock:
    """Time that passes only when somebody sleeps [s]."""

    now: float = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0.0
        self.now += seconds


def until(condition: Callable[[], object], limit: float = 30.0) -> bool:
    """Whether it comes true in time [s]."""
    pause = threading.Event()
    for _ in range(round(limit / 0.005)):
        if condition():
            return True
        pause.wait(0.005)
    return False
