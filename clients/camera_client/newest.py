"""A place for one frame, between the thread of a camera and who uses its frames: a new one replaces the old one."""

import math
import threading
import time
from collections.abc import Callable

from camera_client.frame import RgbdFrame


class Newest:
    """Holds the newest frame until somebody takes it.

    Attributes:
        age: How old the frame that was taken last was when it was taken [s]; NaN before the first.
        missed: Frames that nobody took.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin without a frame.

        Args:
            clock: The clock of `RgbdFrame.t_capture` [s].
        """
        self.age = math.nan
        self.missed = 0
        self._clock = clock
        self._frame: RgbdFrame | None = None
        self._closed = False
        self._changed = threading.Condition()

    def put(self, frame: RgbdFrame) -> None:
        """Offer a frame. An older one that still waits is gone."""
        with self._changed:
            self.missed += self._frame is not None
            self._frame = frame
            self._changed.notify_all()

    def take(self, timeout: float) -> RgbdFrame | None:
        """The newest frame that was not taken yet; None where none comes in time [s], or after `close`."""
        with self._changed:
            self._changed.wait_for(lambda: self._frame is not None or self._closed, timeout)
            frame, self._frame = self._frame, None
            if frame is not None:
                self.age = self._clock() - frame.t_capture
            return frame

    def close(self) -> None:
        """Let nobody wait any more."""
        with self._changed:
            self._closed = True
            self._frame = None
            self._changed.notify_all()
