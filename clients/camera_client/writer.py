"""Writes a recording frame by frame, each in one piece, so that a crash costs no more than the frame it comes in."""

import json
from pathlib import Path
from typing import Any

from camera_client.archive import END, pack_file
from camera_client.frame import RgbdFrame
from camera_client.pictures import encode_colour, encode_depth
from camera_client.recording import COLOUR, DEPTH, FORMAT, LINE, META, VERSION, RecordingError


class Writer:
    """Writes one recording, and waits for the disk. For use while an operator moves, see `recorder`.

    Attributes:
        written: Frames that are in the file.
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
        self._path = path
        self._source = source
        self._first: RgbdFrame | None = None
        try:
            self._file = path.open("xb", buffering=0)
        except FileExistsError:
            raise RecordingError(f"{path} exists already: give another name") from None
        except OSError as error:
            raise RecordingError(f"{path} cannot be written: {error.strerror or error}") from None

    def check(self, frame: RgbdFrame) -> None:
        """Refuse a frame that cannot be part of this recording.

        Raises:
            ValueError: It has no colour, or is of another camera or size than the first.
        """
        if frame.colour is None:
            raise ValueError("a frame without colour cannot be recorded")
        first = self._first = self._first or frame
        alike = frame.size == first.size and frame.intrinsics == first.intrinsics
        if not alike or (frame.depth is None) != (first.depth is None):
            raise ValueError("all frames of a recording must be of the same camera and size")

    def write(self, sequence: int, frame: RgbdFrame, held: bool | None = None) -> None:
        """Add a frame.

        Args:
            sequence: Its number, greater than that of the frame before.
            frame: What the camera saw, after the frame before.
            held: Whether the hold-to-run switch was held; None where nobody knows.

        Raises:
            ValueError: See `check`.
            OSError: It cannot be written.
        """
        self.check(frame)
        meta = b"" if self.written else pack_file(META, _json(_meta(frame, self._source)))
        self._write(meta + _files(sequence, frame, held))
        self.written += 1

    def close(self, whole: bool = True) -> None:
        """Close the file; one without frames is removed. Once is enough, twice does no harm.

        Args:
            whole: Whether to mark its end: not after a fault.

        Raises:
            OSError: The end cannot be written; the file is closed all the same.
        """
        if self._file.closed:
            return
        with self._file:
            if not self.written:
                self._path.unlink(missing_ok=True)
            elif whole:
                self._write(END)

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]


def _meta(frame: RgbdFrame, source: str) -> dict[str, Any]:
    width, height = frame.size
    camera = frame.intrinsics
    return {
        "format": FORMAT,
        "version": VERSION,
        "width": width,
        "height": height,
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "depth": frame.depth is not None,
        "source": source,
    }


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
