"""A camera without depth, through OpenCV. Distances are then guessed from limb lengths, which is worse.

- A thread takes every picture, so that no old one waits in a queue of the driver.
- A webcam does not say when a picture was taken. It is taken to be a fixed time older than its arrival.
- Nor does it say how wide it sees. It is taken to be a pinhole camera with a given horizontal field of view.
"""

import math
import threading
import time
from collections.abc import Callable
from typing import Any

from camera_client.frame import Intrinsics, RgbdFrame
from camera_client.newest import Newest
from camera_client.opencv import cv2
from camera_client.source import DEFAULT_FIELD_OF_VIEW, DEFAULT_LATENCY, SourceError

_RETRY = 1.0
"""Time between two attempts to open a camera that was unplugged [s]."""
_NARROWEST, _WIDEST = math.radians(20.0), math.radians(150.0)
_LONGEST_LATENCY = 1.0
_LONGEST_GOODBYE = 2.0
_WIDTH, _HEIGHT = 640, 360
"""What is asked for; a camera may have something near."""


def pinhole(width: int, height: int, field_of_view: float) -> Intrinsics:
    """A pinhole camera that looks through the middle of its picture.

    Args:
        width: Of the picture [pixel].
        height: Of the picture [pixel].
        field_of_view: From its left to its right edge [rad].

    Returns:
        Its intrinsics; pixels are square.
    """
    focal = 0.5 * width / math.tan(0.5 * field_of_view)
    return Intrinsics(focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))


def open_capture(which: str) -> Any:
    """A `cv2.VideoCapture` of a camera's number or device; it may turn out not to be open."""
    capture = cv2.VideoCapture(int(which) if which.isdecimal() else which)
    if capture.isOpened():
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, _WIDTH)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, _HEIGHT)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    return capture


class WebcamSource:
    """A webcam as a `FrameSource`. One that is unplugged is taken back when it returns.

    Attributes:
        has_depth: It has none.
        fault: Why no pictures come; empty while they do.
        newest: The frame that waits.
    """

    has_depth = False

    def __init__(
        self,
        which: str,
        field_of_view: float = DEFAULT_FIELD_OF_VIEW,
        latency: float = DEFAULT_LATENCY,
        open_capture: Callable[[str], Any] = open_capture,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Open the camera and begin to take pictures.

        Args:
            which: Its number, or its device.
            field_of_view: Horizontal [rad].
            latency: How long before its arrival a picture was taken [s].
            open_capture: What opens it.
            clock: Monotonic time [s].

        Raises:
            SourceError: It cannot be opened, or what is said of it is impossible.
        """
        if not _NARROWEST <= field_of_view <= _WIDEST:
            low, high = math.degrees(_NARROWEST), math.degrees(_WIDEST)
            raise SourceError(f"a webcam sees {low:.0f} to {high:.0f} degrees, not {math.degrees(field_of_view):g}")
        if not 0.0 <= latency <= _LONGEST_LATENCY:
            raise SourceError(f"a webcam's latency is 0 to {_LONGEST_LATENCY:g} s, not {latency:g}")
        self.fault = ""
        self.newest = Newest(clock)
        self._which = which
        self._field_of_view = field_of_view
        self._latency = latency
        self._open = open_capture
        self._clock = clock
        self._closing = threading.Event()
        self._capture = open_capture(which)
        if not self._capture.isOpened():
            self._capture.release()
            raise SourceError(
                f"webcam {which} cannot be opened: is it plugged in, used by another program, or may you not read it "
                "(group video)? `v4l2-ctl --list-devices` lists cameras"
            )
        self._size = self._capture.get(cv2.CAP_PROP_FRAME_WIDTH), self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
        self._thread = threading.Thread(target=self._run, name="webcam", daemon=True)
        self._thread.start()

    @property
    def description(self) -> str:
        """What it is, for people."""
        return (
            f"webcam {self._which}, no depth: {self._size[0]:.0f} x {self._size[1]:.0f}, "
            f"taken to see {math.degrees(self._field_of_view):.0f} degrees and to be {1e3 * self._latency:.0f} ms late"
        )

    @property
    def age(self) -> float:
        """How old the last frame was when it was given, if the latency is right [s]."""
        return self.newest.age

    @property
    def finished(self) -> bool:
        """Whether it is closed."""
        return self._closing.is_set()

    def next(self, timeout: float) -> RgbdFrame | None:
        """See `FrameSource.next`."""
        return self.newest.take(timeout)

    def close(self) -> None:
        """Give the camera back."""
        self._closing.set()
        self.newest.close()
        # A camera that hangs must not keep the program from ending.
        self._thread.join(_LONGEST_GOODBYE)

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                if not self._take():
                    self.fault = f"webcam {self._which} gives no pictures: is it still plugged in?"
                    self._reopen()
        finally:
            self._capture.release()

    def _take(self) -> bool:
        """Wait for a picture and offer it."""
        if not self._capture.grab():
            return False
        arrival = self._clock()
        good, picture = self._capture.retrieve()
        if not good or picture is None or picture.ndim != 3:
            return False
        height, width = picture.shape[:2]
        colour = cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)
        camera = pinhole(width, height, self._field_of_view)
        self.newest.put(RgbdFrame(arrival - self._latency, None, camera, colour))
        self.fault = ""
        return True

    def _reopen(self) -> None:
        self._capture.release()
        if not self._closing.wait(_RETRY):
            self._capture = self._open(self._which)
