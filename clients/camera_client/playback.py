"""A recording as a source: it plays as it was recorded, in real time, once.

Frames come when they were captured, by a clock that begins with the first that is asked for. Who is slow misses frames
as with a camera. The switch of the operator who was recorded plays along.
"""

import bisect
import math
import time
from collections.abc import Callable

from camera_client.frame import RgbdFrame
from camera_client.recording import Recording, RecordingError
from camera_client.source import SourceError


class Playback:
    """Plays a recording, which it closes in the end.

    Attributes:
        recording: What is played.
        held: Whether the hold-to-run switch was held at the frame that was given last; None where nobody knew.
        fault: Why the recording ended before its end; else empty.
        age: How old the last frame was when it was given [s].
    """

    has_depth: bool

    def __init__(
        self,
        recording: Recording,
        speed: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Prepare; time begins when the first frame is asked for.

        Args:
            recording: What to play.
            speed: How many times faster than it was.
            clock: Monotonic time [s].
            sleep: Waits for a time [s].

        Raises:
            SourceError: The speed is not positive.
        """
        if not 0.0 < speed < math.inf:
            recording.close()
            raise SourceError(f"a recording cannot be played {speed:g} times as fast")
        self.recording = recording
        self.held: bool | None = None
        self.fault = ""
        self.age = math.nan
        self.has_depth = recording.meta.has_depth
        self._times = [(entry.t_capture - recording.entries[0].t_capture) / speed for entry in recording.entries]
        self._clock = clock
        self._sleep = sleep
        self._begin: float | None = None
        self._next = 0

    @property
    def description(self) -> str:
        """What it is, for people."""
        meta, source = self.recording.meta, self.recording.meta.source
        depth = "" if self.has_depth else " without depth"
        cut = ", cut off" if self.recording.cut else ""
        recorded = f" of {source}" if source else ""
        return (
            f"recording {self.recording.path}{recorded}: {meta.width} x {meta.height}{depth}, "
            f"{self.recording.duration:.1f} s{cut}"
        )

    @property
    def finished(self) -> bool:
        """Whether the last frame has been given, or none can be given any more."""
        return self._next >= len(self._times)

    def next(self, timeout: float) -> RgbdFrame | None:
        """See `FrameSource.next`."""
        now = self._clock()
        deadline = now + timeout
        if self._begin is None:
            self._begin = now
        if self.finished:
            return None
        due = self._begin + self._times[self._next]
        while now < due:
            if now >= deadline:
                return None
            self._sleep(min(due, deadline) - now)
            now = self._clock()
        if self.finished:
            return None  # Another thread has closed it meanwhile.
        # Times may differ from those compared above by rounding, so it is at least the one that is due.
        number = max(self._next, bisect.bisect_right(self._times, now - self._begin) - 1)
        t_capture = self._begin + self._times[number]
        try:
            frame = self.recording.frame(number, t_capture)
        except RecordingError as error:
            if not self.finished:
                self.fault = str(error)
                self.close()
            return None
        self._next = number + 1
        self.held = self.recording.entries[number].held
        self.age = self._clock() - t_capture
        if self.finished:
            self.close()
        return frame

    def close(self) -> None:
        """Close the recording."""
        self._next = len(self._times)
        self.recording.close()
