"""A Luxonis OAK-D as a source: colour, and depth from stereo aligned to it.

A camera that goes away, or sends nothing for a while, is a fault; it is looked for until it is there again.
"""

import math
import threading
import time
from collections.abc import Callable

from camera_client.frame import RgbdFrame
from camera_client.oak_device import SIZE, OakLink, connect
from camera_client.oak_frames import FPS, OakLost
from camera_client.source import SourceError

_SILENT = 3.0
"""Time without a frame after which a camera is taken to be gone; it may need one or two for its first [s]."""
_RETRY = 2.0
"""Time between two attempts to find it again [s]."""


class OakSource:
    """An OAK camera as a `FrameSource`.

    Attributes:
        has_depth: It has.
        fault: Why no frames come; empty while they do.
    """

    has_depth = True

    def __init__(
        self,
        which: str = "",
        connect: Callable[[str], OakLink] = connect,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Find the camera and start it.

        Args:
            which: Its device id; empty for any.
            connect: What finds it.
            clock: Monotonic time [s].

        Raises:
            SourceError: It cannot be started.
        """
        self.fault = ""
        self._which = which
        self._connect = connect
        self._clock = clock
        self._link: OakLink | None = connect(which)
        self._name = self._link.name
        self._heard = clock()
        self._age = math.nan
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._search: threading.Thread | None = None

    @property
    def description(self) -> str:
        """What it is, for people."""
        return f"{self._name}: {SIZE[0]} x {SIZE[1]} with depth, {FPS:.0f} a second"

    @property
    def age(self) -> float:
        """How old the last frame was when it was given [s]."""
        return self._age

    @property
    def finished(self) -> bool:
        """Whether it is closed."""
        return self._closing.is_set()

    def next(self, timeout: float) -> RgbdFrame | None:
        """See `FrameSource.next`. A camera that is gone is looked for meanwhile."""
        with self._changed:
            self._changed.wait_for(lambda: self._link is not None or self.finished, timeout)
            link = self._link
        if link is None or self.finished:
            return None
        try:
            frame = link.frames.next(timeout)
        except OakLost as lost:
            # It may have been closed by another thread meanwhile.
            if not self.finished:
                self._lose(link, str(lost))
            return None
        if frame is not None:
            self._age, self._heard, self.fault = link.frames.age, self._clock(), ""
        elif self._clock() - self._heard > _SILENT:
            self._lose(link, f"it has sent nothing for {_SILENT:g} s")
        return frame

    def close(self) -> None:
        """Give the camera back."""
        self._closing.set()
        with self._changed:
            link, self._link = self._link, None
            self._changed.notify_all()
        if link is not None:
            _end(link)
        if self._search is not None:
            self._search.join()

    def _lose(self, link: OakLink, why: str) -> None:
        self.fault = f"{self._name} is lost ({why}): is it still plugged in?"
        self._link = None
        self._search = threading.Thread(target=self._find, args=(link,), name="oak", daemon=True)
        self._search.start()

    def _find(self, lost: OakLink) -> None:
        # Ending a camera that is gone takes a while, too.
        _end(lost)
        while not self._closing.wait(_RETRY):
            try:
                link = self._connect(self._which)
            except (SourceError, RuntimeError):
                continue
            with self._changed:
                if not self.finished:
                    self._link, self._name, self._heard = link, link.name, self._clock()
                    self._changed.notify_all()
                    return
            _end(link)


def _end(link: OakLink) -> None:
    try:
        link.close()
    except RuntimeError:
        # It is gone: there is nothing left to end.
        return
