"""The camera's thread: frame ─> pose model ─> chain ─> tracker, as fast as they go, the newest frame each time.

It has a thread of its own because the pose model takes longer than a tick of the teleop loop; it works outside of
Python's lock. Whatever goes wrong here is a frame that is missing: the tracker's frames grow old, and the arms hold.
"""

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from camera_client.chain import Chain
from camera_client.frame import RgbdFrame
from camera_client.landmarks import Landmarks
from camera_client.source import FrameSource
from camera_client.stages import Stages
from camera_client.tracker import CameraTracker, Look

_PATIENCE = 0.1
"""How long a frame is waited for at a time [s]."""
_END_LIMIT = 5.0


class Detector(Protocol):
    """What finds a person in a picture."""

    def detect(self, colour: NDArray[np.uint8], t_capture: float) -> Landmarks | None:
        """Look for a person; see `detector.PoseDetector`."""
        ...


class Perception:
    """Runs the thread.

    Attributes:
        frames: Frames that came.
        first: When the first one was captured [s]; None before.
        bodies: Frames in which the pose model found somebody.
        fault: What went wrong last, in one line; empty while all is well.
    """

    def __init__(
        self,
        source: FrameSource,
        detector: Detector,
        chain: Chain,
        tracker: CameraTracker,
        stages: Stages,
        *,
        watch: Callable[[Look], None] = lambda _look: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Prepare; `start` starts it.

        Args:
            source: Where frames come from.
            detector: The pose model.
            chain: From landmarks to arms.
            tracker: Takes the looks.
            stages: Takes what each part took.
            watch: Called with every look, in this thread.
            clock: Monotonic time, that of the source's captures and the loop's [s].
        """
        self.frames = 0
        self.first: float | None = None
        self.bodies = 0
        self.fault = ""
        self._source, self._detector, self._chain = source, detector, chain
        self._tracker, self._stages, self._watch = tracker, stages, watch
        self._clock = clock
        self._end = threading.Event()
        self._release = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ik-camera perception", daemon=True)

    def start(self) -> None:
        """Begin; a recording begins to play."""
        self._thread.start()

    @property
    def finished(self) -> bool:
        """Whether no look will come any more."""
        return self._thread.ident is not None and not self._thread.is_alive()

    def release_operator(self) -> None:
        """The next body that is seen is the operator. Call `TeleopLoop.stop` as well."""
        self._release.set()

    def close(self) -> None:
        """End the thread. It is awaited for a while; a camera that hangs is left to itself."""
        self._end.set()
        if self._thread.ident is not None:
            self._thread.join(_END_LIMIT)

    def step(self) -> None:
        """Take one frame, if one comes in time."""
        frame = self._source.next(_PATIENCE)
        if frame is None:
            self.fault = self._source.fault or self.fault
            return
        received = self._clock()
        self.frames += 1
        self.first = frame.t_capture if self.first is None else self.first
        try:
            look = self._look(frame, received)
        except Exception as error:  # whatever a model or a frame does, the next one may be fine
            self.fault = f"{type(error).__name__}: {' '.join(str(error).split())}"
            return
        self.fault = self._source.fault
        self._watch(look)

    def _look(self, frame: RgbdFrame, received: float) -> Look:
        if self._release.is_set():
            self._release.clear()
            self._chain.lock.release()
        landmarks = None if frame.colour is None else self._detector.detect(frame.colour, frame.t_capture)
        found = self._clock()
        self.bodies += landmarks is not None
        lifted: list[float] = []
        estimate = self._chain.update(frame, landmarks, lambda: lifted.append(self._clock()))
        look = Look(
            frame=frame,
            landmarks=landmarks,
            estimate=estimate,
            captured=min(frame.t_capture, received),
            received=received,
            ready=self._clock(),
            held=getattr(self._source, "held", None),
            refused=self._chain.lock.refused,
        )
        self._tracker.feed(look)
        self._stages.seen(look, found, lifted[0] if lifted else None)
        return look

    def _run(self) -> None:
        with contextlib.suppress(KeyboardInterrupt):
            while not (self._end.is_set() or self._source.finished):
                self.step()
