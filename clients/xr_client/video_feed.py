"""Brings the robot's eye images to the pages: a thread that watches the robot while a page watches.

- While no page does, the source is closed and the thread sleeps: then the robot makes no images either. While a page
  watches, one is asked for only when it would go out at once: where drawing is dear, none is drawn to be dropped.
- A source that is lost, or not there yet, is opened again after pauses that grow to `LONGEST_PAUSE`.
- Images are numbered anew, so that numbers rise even when the robot's end was started again.
- `taken_ms` stays the robot's where robot and server read the same clock. Two machines' clocks are not compared: there
  the time of arrival takes its place, and an image's way to this machine does not count in its age.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import Self

from ik_client.eyes import EyesError, EyeSource, open_eyes
from xr_client.video_socket import VideoSocket

FIRST_PAUSE, LONGEST_PAUSE = 0.1, 2.0
"""Between two attempts to open the source [s]."""

SILENT_AFTER = 3.0
"""Time without an image after which that is said [s]; the first after a while takes about one."""

_TURN = 0.25
"""How long the thread sleeps before it looks whether it is to end [s]."""

_NO_SOURCE = "the robot sends no pictures: it was started with --eyes-to off, or its machine cannot render"


class VideoFeed:
    """Images from one robot to one video socket."""

    def __init__(
        self,
        source_url: str,
        robot: str,
        video: VideoSocket,
        *,
        open_source: Callable[[str, str], EyeSource] = open_eyes,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Wait for a page that watches.

        Args:
            source_url: Where the robot's images are, see `ik_client.eyes`; empty where it sends none.
            robot: Its name.
            video: Where they go.
            open_source: Opens the source.
            clock: Monotonic time, that of the video socket [s].
        """
        self._url = source_url
        self._robot = robot
        self._video = video
        self._open = open_source
        self._clock = clock
        self._fault = "" if source_url else _NO_SOURCE
        self._seq = 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="video feed", daemon=True)
        if source_url:
            self._thread.start()

    @property
    def fault(self) -> str:
        """Why there are no images, in one line; empty where there are, or nobody watches."""
        return self._fault

    def close(self) -> None:
        """End it."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it."""
        self.close()

    def _run(self) -> None:
        pause = FIRST_PAUSE
        while not self._closing.is_set():
            if not self._video.wait_watched(_TURN):
                self._fault, pause = "", FIRST_PAUSE
                continue
            before = self._seq
            try:
                with self._open(self._url, self._robot) as source:
                    self._pass_on(source)
            except EyesError as error:
                self._fault = f"no pictures: {error}"
                pause = FIRST_PAUSE if self._seq != before else min(2.0 * pause, LONGEST_PAUSE)
                self._closing.wait(pause)
            except ValueError as error:  # a URL of another kind stays one
                self._fault = f"no pictures: {error}"
                return

    def _pass_on(self, source: EyeSource) -> None:
        """Hand images over until no page watches."""
        seen, since = -1, self._clock()
        while self._video.watched and not self._closing.is_set():
            if not self._video.wait_wanted(_TURN):
                since = self._clock()  # the page is what is late
                continue
            frame = source.wait(seen, _TURN)
            now = self._clock()
            if frame is not None:
                seen, since, self._fault = frame.seq, now, ""
                self._seq = (self._seq + 1) % 2**32
                taken_ms = frame.taken_ms if source.same_clock else 1e3 * now
                self._video.publish(replace(frame, seq=self._seq, taken_ms=taken_ms))
            elif now - since > SILENT_AFTER:
                self._fault = f"no pictures: the robot has sent none for {now - since:.0f} s"
