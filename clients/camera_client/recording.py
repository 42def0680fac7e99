"""Recordings of a camera (`.ikcam`), as docs/ikcam.md describes them: a plain tar of pictures and what belongs to them.

`meta.json` comes first. Every frame is a JPEG of its colours, a PNG of its depth where the camera measures any, and a
line of JSON, in this order: a frame of which the last is there is whole. The end of the archive may be missing.

A file that ends within a frame was cut off; what came before counts. Anything else that is not as described is refused,
as a `RecordingError` in one line.
"""

import json
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from camera_client.archive import ArchiveError, CutOff, read_files
from camera_client.frame import Intrinsics, RgbdFrame
from camera_client.pictures import PictureError, decode_colour, decode_depth
from camera_client.source import SourceError

FORMAT, VERSION = "ikcam", 1
META, COLOUR, DEPTH, LINE = "meta.json", "jpg", "png", "time.json"
"""Name of the first file; endings of those of a frame, `00000000.jpg` and so on. They sort in the order they have."""
LARGEST_SIDE = 4096
"""Of a picture [pixel]."""
LARGEST = {META: 1 << 16, COLOUR: 1 << 25, DEPTH: 1 << 26, LINE: 1 << 12}
"""How long files may be [byte]."""


class RecordingError(SourceError):
    """A file that is no recording; says why, in one line."""


@dataclass(frozen=True, slots=True)
class Meta:
    """What all frames of a recording have in common.

    Attributes:
        width: Of a picture [pixel].
        height: Of a picture [pixel].
        intrinsics: The camera.
        has_depth: Whether frames have depth.
        source: What they were recorded from, for people.
    """

    width: int
    height: int
    intrinsics: Intrinsics
    has_depth: bool
    source: str = ""


@dataclass(frozen=True, slots=True)
class Entry:
    """A frame of a recording, not yet read.

    Attributes:
        sequence: Its number while recording; one that is missing was dropped.
        t_capture: When it was taken, by the clock of the recording machine [s]; grows from frame to frame.
        held: Whether the hold-to-run switch was held; None where nobody knew.
        colour: Where its JPEG begins and how long it is [byte].
        depth: The same of its PNG; None where the camera measures no depth.
    """

    sequence: int
    t_capture: float
    held: bool | None
    colour: tuple[int, int]
    depth: tuple[int, int] | None


class Recording:
    """An open recording. Frames are decoded when they are asked for.

    Attributes:
        path: The file.
        meta: What all frames have in common.
        entries: Its frames, at least one.
        cut: Whether the file ends within a frame.
    """

    def __init__(self, path: Path) -> None:
        """Open a recording and find its frames.

        Args:
            path: The file.

        Raises:
            RecordingError: It cannot be read, or is no recording, or holds no frame.
        """
        self.path = path
        self.cut = False
        try:
            self._file: BinaryIO = path.open("rb")
        except OSError as error:
            raise RecordingError(f"{path} cannot be read: {error.strerror or error}") from None
        try:
            self.meta, self.entries = self._scan()
        except OSError as error:
            self.close()
            raise RecordingError(f"{path} cannot be read: {error.strerror or error}") from None
        except RecordingError:
            self.close()
            raise

    def __len__(self) -> int:
        """How many frames it has."""
        return len(self.entries)

    @property
    def duration(self) -> float:
        """Time from the first to the last frame [s]."""
        return self.entries[-1].t_capture - self.entries[0].t_capture

    def frame(self, number: int, t_capture: float | None = None) -> RgbdFrame:
        """Decode a frame.

        Args:
            number: Which, from 0.
            t_capture: When it is to seem taken [s]; None for when it was.

        Returns:
            The frame.

        Raises:
            RecordingError: Its pictures are broken.
        """
        entry, size = self.entries[number], (self.meta.width, self.meta.height)
        try:
            return RgbdFrame(
                t_capture=entry.t_capture if t_capture is None else t_capture,
                depth=None if entry.depth is None else decode_depth(self._read(*entry.depth), size),
                intrinsics=self.meta.intrinsics,
                colour=decode_colour(self._read(*entry.colour), size),
            )
        except PictureError as error:
            raise RecordingError(f"frame {entry.sequence} of {self.path} is {error}") from None
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be read: {error.strerror or error}") from None

    def frames(self) -> Iterator[tuple[RgbdFrame, bool | None]]:
        """All frames with the state of the hold-to-run switch, without waiting.

        Raises:
            RecordingError: A picture is broken.
        """
        for number, entry in enumerate(self.entries):
            yield self.frame(number), entry.held

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _read(self, begin: int, size: int) -> bytes:
        try:
            return os.pread(self._file.fileno(), size, begin)
        except ValueError:
            raise RecordingError(f"{self.path} is closed") from None

    def _scan(self) -> tuple[Meta, list[Entry]]:
        files = read_files(self._file.fileno(), _largest)
        entries: list[Entry] = []
        try:
            name, begin, size = next(files, ("", 0, 0))
            if name != META:
                raise RecordingError(f"{self.path} is no recording of ik-camera")
            meta = self._meta(self._read(begin, size))
            self._scan_frames(meta, files, entries)
        except ArchiveError as error:
            raise RecordingError(f"{self.path} is no recording of ik-camera: {error}") from None
        except CutOff:
            self.cut = True
        if not entries:
            raise RecordingError(f"{self.path} holds no whole frame")
        return meta, entries

    def _scan_frames(self, meta: Meta, files: Iterator[tuple[str, int, int]], entries: list[Entry]) -> None:
        wanted = (COLOUR, DEPTH, LINE) if meta.has_depth else (COLOUR, LINE)
        sequence, found = 0, {}
        for name, begin, size in files:
            number, _, kind = name.partition(".")
            of_frame = number.isascii() and number.isdecimal() and (not found or int(number) == sequence)
            if kind != wanted[len(found)] or not of_frame:
                raise RecordingError(f"{name!r} of {self.path} is not what a recording has at this place")
            sequence, found[kind] = int(number), (begin, size)
            if kind == LINE:
                entries.append(self._entry(sequence, found, entries[-1] if entries else None))
                found = {}
        self.cut = bool(found)

    def _meta(self, data: bytes) -> Meta:
        try:
            content: Any = json.loads(data)
            if (content["format"], content["version"]) != (FORMAT, VERSION):
                raise RecordingError(f"{self.path} is no recording of ik-camera in version {VERSION}")
            numbers = [float(content[name]) for name in ("fx", "fy", "cx", "cy")]
            meta = Meta(
                int(content["width"]),
                int(content["height"]),
                Intrinsics(*numbers),
                bool(content["depth"]),
                _printable(str(content.get("source", ""))),
            )
        except (TypeError, KeyError, AttributeError, OverflowError, RecursionError, ValueError) as error:
            if isinstance(error, RecordingError):
                raise
            raise RecordingError(f"{META} of {self.path} does not describe a camera") from None
        sides = 0 < meta.width <= LARGEST_SIDE and 0 < meta.height <= LARGEST_SIDE
        if not (sides and all(map(math.isfinite, numbers)) and min(numbers[:2]) > 0.0):
            raise RecordingError(f"{META} of {self.path} describes an impossible camera")
        return meta

    def _entry(self, sequence: int, files: dict[str, tuple[int, int]], last: Entry | None) -> Entry:
        try:
            content: Any = json.loads(self._read(*files[LINE]))
            t_capture, held = float(content["t_capture"]), content.get("held")
        except (TypeError, KeyError, AttributeError, OverflowError, RecursionError, ValueError):
            raise RecordingError(f"frame {sequence} of {self.path} does not say when it was taken") from None
        newer = last is None or (t_capture > last.t_capture and sequence > last.sequence)
        if not (newer and math.isfinite(t_capture) and held in (None, True, False)):
            raise RecordingError(f"frame {sequence} of {self.path} has an impossible time or switch")
        return Entry(sequence, t_capture, None if held is None else bool(held), files[COLOUR], files.get(DEPTH))


def _largest(name: str) -> int:
    return LARGEST.get(name, LARGEST.get(name.partition(".")[2], -1))


def _printable(text: str) -> str:
    """One line of it that a terminal can be shown."""
    return "".join(letter for letter in text if letter.isprintable())[:200]
