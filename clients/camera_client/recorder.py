"""Writes recordings without ever making who watches wait: frames it cannot keep up with are dropped and counted.

A file is written frame by frame, each in one piece, so that a crash costs at most the frames that were still waiting.
"""

import json
import queue
import threading
from pathlib import Path
from typing import Any

from camera_client.archive import END, pack_file
from camera_client.frame import RgbdFrame
from camera_client.pictures import encode_colour, encode_depth
from camera_client.recording import COLOUR, DEPTH, FORMAT, LINE, META, VERSION, RecordingError

_WAITING = 8
"""How many frames may wait to be written."""


class Recorder:
    """Writes one recording in a thread of its own. Call it from one thread, and close it.

    Attributes:
        written: Frames that are in the file.
        dropped: Frames that are not: they came too fast, were not newer than the one before, or there was a fault.
        fault: Why nothing is written any more, in one line; empty while all is well.
    """

    def __init__(self, path: Path, source: str = "") -> None:
        """Begin a recording.

        Args:
            path: The file; there must be none yet.
            source: What it is recorded from, for people.

        Raises:
            RecordingError: The file cannot be made.
        """
        self.written = 0
        self.dropped = 0
        self.fault = ""
        self._path = path
        self._source = source
        self._sequence = 0
        self._first: RgbdFrame | None = None
        self._last = -float("inf")
        try:
            self._file = path.open("xb", buffering=0)
        except FileExistsError:
            raise RecordingError(f"{path} exists already: give another name") from None
        except OSError as error:
            raise RecordingError(f"{path} cannot be written: {error.strerror or error}") from None
        self._queue: queue.Queue[tuple[int, RgbdFrame, bool | None] | None] = queue.Queue(_WAITING)
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def write(self, frame: RgbdFrame, held: bool | None = None) -> bool:
        """Add a frame, at once or not at all.

        Args:
            frame: With colour; all frames of the same size, by the same camera, with depth or without.
            held: Whether the hold-to-run switch was held; None where nobody knows.

        Returns:
            Whether it will be written, unless there is a fault.

        Raises:
            ValueError: It has no colour, or differs from the first frame.
        """
        self._check(frame)
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
        if self._file.closed:
            return
        self._queue.put(None)
        self._thread.join()
        with self._file:
            if not self.written:
                self._path.unlink(missing_ok=True)
            elif not self.fault:
                try:
                    self._write(END)
                except OSError as error:
                    self.fault = f"{self._path} cannot be ended: {error.strerror or error}"

    def _check(self, frame: RgbdFrame) -> None:
        if frame.colour is None:
            raise ValueError("a frame without colour cannot be recorded")
        first = self._first = self._first or frame
        alike = frame.size == first.size and frame.intrinsics == first.intrinsics
        if not alike or (frame.depth is None) != (first.depth is None):
            raise ValueError("all frames of a recording must be of the same camera and size")

    def _run(self) -> None:
        while (job := self._queue.get()) is not None:
            sequence, frame, held = job
            if self.fault:
                self.dropped += 1
                continue
            try:
                first = b"" if self.written else self._meta(frame)
                self._write(first + _files(sequence, frame, held))
                self.written += 1
            # Whatever it is: without this thread `close` would wait for ever.
            except Exception as error:
                reason = error.strerror if isinstance(error, OSError) else None
                self.fault = f"{self._path} cannot be written any more: {reason or error}"
                self.dropped += 1

    def _meta(self, frame: RgbdFrame) -> bytes:
        width, height = frame.size
        camera = frame.intrinsics
        return _file(
            META,
            _json(
                {
                    "format": FORMAT,
                    "version": VERSION,
                    "width": width,
                    "height": height,
                    "fx": camera.fx,
                    "fy": camera.fy,
                    "cx": camera.cx,
                    "cy": camera.cy,
                    "depth": frame.depth is not None,
                    "source": self._source,
                }
            ),
        )

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]


def _files(sequence: int, frame: RgbdFrame, held: bool | None) -> bytes:
    assert frame.colour is not None
    parts = {COLOUR: encode_colour(frame.colour)}
    if frame.depth is not None:
        parts[DEPTH] = encode_depth(frame.depth)
    line: dict[str, Any] = {"t_capture": frame.t_capture}
    parts[LINE] = _json(line if held is None else line | {"held": held})
    return b"".join(pack_file(f"{sequence:08d}.{kind}", content) for kind, content in parts.items())


def _json(content: dict[str, Any]) -> bytes:
    return json.dumps(content).encode() + b"\n"
