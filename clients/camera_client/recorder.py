"""Records without ever making who watches wait: frames that the disk cannot keep up with are dropped and counted."""

import math
import queue
import threading
from pathlib import Path

from camera_client.frame import RgbdFrame
from camera_client.writer import Writer

_WAITING = 8
"""How many frames may wait to be written."""


class Recorder:
    """Writes one recording in a thread of its own. Call it from one thread, and close it.

    Attributes:
        dropped: Frames that are not in the file: they came too fast, were not newer than the one before, or there was a
            fault.
        fault: Why nothing is written any more, in one line; empty while all is well.
    """

    def __init__(self, path: Path, source: str = "") -> None:
        """Begin a recording.

        Args:
            path: The file; there must be none yet.
            source: What it is recorded from, for people.

        Raises:
            camera_client.recording.RecordingError: The file cannot be made.
        """
        self.dropped = 0
        self.fault = ""
        self._path = path
        self._writer = Writer(path, source)
        self._sequence = 0
        self._last = -math.inf
        self._queue: queue.Queue[tuple[int, RgbdFrame, bool | None] | None] = queue.Queue(_WAITING)
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def written(self) -> int:
        """Frames that are in the file."""
        return self._writer.written

    def write(self, frame: RgbdFrame, held: bool | None = None) -> bool:
        """Add a frame, at once or not at all.

        Args:
            frame: With colour; all frames of the same camera and size, with depth or without.
            held: Whether the hold-to-run switch was held; None where nobody knows.

        Returns:
            Whether it will be written, unless there is a fault.

        Raises:
            ValueError: It has no colour, or is of another camera or size than the first.
        """
        self._writer.check(frame)
        sequence = self._sequence
        self._sequence += 1
        if frame.t_capture > self._last and not self.fault:
            try:
                self._queue.put_nowait((sequence, frame, held))
            except queue.Full:
                pass
            else:
                self._last = frame.t_capture
                return True
        self.dropped += 1
        return False

    def close(self) -> None:
        """Write what still waits and end the file; one without frames is removed. Twice does no harm."""
        if not self._thread.is_alive():
            return
        self._queue.put(None)
        self._thread.join()
        try:
            self._writer.close(whole=not self.fault)
        except OSError as error:
            self._fail(error)

    def _run(self) -> None:
        while (job := self._queue.get()) is not None:
            if not self.fault:
                try:
                    self._writer.write(*job)
                    continue
                # Whatever it is: without this thread `close` would wait for ever.
                except Exception as error:
                    self._fail(error)
            self.dropped += 1

    def _fail(self, error: Exception) -> None:
        reason = error.strerror if isinstance(error, OSError) else None
        self.fault = f"{self._path} cannot be written any more: {reason or error}"
