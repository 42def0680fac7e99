"""Where frames come from: a camera with depth, one without, or a recording, all of them the same to who uses them.

A source gives the newest frame there is, and every frame at most once. Who is slow misses frames and never gets an old
one. `t_capture` is on the clock of `time.monotonic`.

| what to open          | source                                                                          |
|-----------------------|---------------------------------------------------------------------------------|
| `oak`                 | a Luxonis OAK-D, the first that is found; depth from stereo                     |
| `oak:14442C10D13EABCE00` | the one with this device id                                                  |
| `webcam:0`            | a camera without depth, by its number                                           |
| `webcam:/dev/video2`  | the same, by its device                                                         |
| a path                | a recording of `ik-camera record`                                               |
"""

import math
from pathlib import Path
from typing import Protocol

from camera_client.frame import RgbdFrame

DEFAULT_FIELD_OF_VIEW = math.radians(60.0)
"""Of a webcam that nobody has measured, from the left to the right edge [rad]."""
DEFAULT_LATENCY = 0.03
"""How long before its arrival a webcam's picture was taken, about [s]."""


class SourceError(ValueError):
    """A source cannot be opened or read; says why and what to do, in one line."""


class FrameSource(Protocol):
    """Gives frames, the newest first and no other."""

    @property
    def description(self) -> str:
        """What it is, for people."""
        ...

    @property
    def has_depth(self) -> bool:
        """Whether its frames have depth."""
        ...

    @property
    def age(self) -> float:
        """How old the frame that was given last was when it was given [s]; NaN before the first."""
        ...

    @property
    def finished(self) -> bool:
        """Whether no frame will come any more: a recording is over, or the source is closed."""
        ...

    @property
    def fault(self) -> str:
        """Why no frames come, in one line; empty while they should come. A camera may recover by itself."""
        ...

    def next(self, timeout: float) -> RgbdFrame | None:
        """Wait for a frame.

        Args:
            timeout: For how long at most [s].

        Returns:
            The newest frame that was not given yet; None where none came in time.
        """
        ...

    def close(self) -> None:
        """Give back the camera or the file. Once is enough, twice does no harm."""
        ...


def open_source(
    what: str,
    *,
    field_of_view: float = DEFAULT_FIELD_OF_VIEW,
    latency: float = DEFAULT_LATENCY,
    speed: float = 1.0,
) -> FrameSource:
    """Open a source.

    Args:
        what: As in the table above.
        field_of_view: Horizontal, of a webcam [rad].
        latency: Of a webcam [s].
        speed: How many times faster than it was a recording is played.

    Returns:
        The source. Close it.

    Raises:
        SourceError: It cannot be opened.
    """
    kind, _, which = what.partition(":")
    try:
        # Each needs a library that the others do not.
        if kind == "oak":
            from camera_client.oak import OakSource

            return OakSource(which)
        if kind == "webcam":
            from camera_client.webcam import WebcamSource

            return WebcamSource(which or "0", field_of_view, latency)
        from camera_client.playback import Playback
        from camera_client.recording import Recording

        return Playback(Recording(Path(what)), speed)
    except ModuleNotFoundError as error:
        extra = "oak" if error.name == "depthai" else "camera"
        raise SourceError(f'{what} needs {error.name}: pip install "ik-service[{extra}]"') from None
