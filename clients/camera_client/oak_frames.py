"""From an OAK's colour and depth to frames: what happens behind the device, the same without one.

Colour and depth of the same moment are put together on the host. A queue of one holds the newest pair; what is not
taken in time is gone. A longer queue would hand out frames that are as old as it is long.
"""

import math
import time
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import numpy as np

from camera_client.depthai_library import depthai as dai
from camera_client.frame import Intrinsics, RgbdFrame
from camera_client.opencv import cv2

FPS = 30.0
COLOUR, DEPTH = "colour", "depth"
QUEUE = 1
"""How many pairs may wait."""


class OakLost(Exception):
    """The camera is gone, or gives what cannot be used; says why."""


def pair_queue(pipeline: Any, colour: Any, depth: Any, size: int = QUEUE) -> Any:
    """Put the frames of two outputs together by their times.

    Args:
        pipeline: A `depthai.Pipeline`.
        colour: Output of colour frames.
        depth: Output of depth frames, aligned to colour.
        size: How many pairs may wait.

    Returns:
        A queue of `depthai.MessageGroup`, that drops the oldest.
    """
    sync = pipeline.create(dai.node.Sync)
    sync.setRunOnHost(True)
    sync.setSyncThreshold(timedelta(seconds=0.5 / FPS))
    colour.link(sync.inputs[COLOUR])
    depth.link(sync.inputs[DEPTH])
    return sync.out.createOutputQueue(maxSize=size, blocking=False)


class OakFrames:
    """Takes frames from a queue of pairs.

    Attributes:
        age: How old the last frame was when it was given [s]; NaN before the first.
    """

    def __init__(self, queue: Any, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin.

        Args:
            queue: Of `pair_queue`.
            clock: Monotonic time [s].
        """
        self.age = math.nan
        self._queue = queue
        self._clock = clock
        self._last = -math.inf

    def next(self, timeout: float) -> RgbdFrame | None:
        """The newest frame that was not given yet; None where none comes in time [s].

        Raises:
            OakLost: The queue was closed, or a pair of it is no frame.
        """
        deadline = self._clock() + timeout
        while True:
            try:
                pair = self._queue.get(timedelta(seconds=max(0.0, deadline - self._clock())))
            except dai.MessageQueue.QueueException:
                raise OakLost("the link to it is closed") from None
            if pair is None:
                return None
            frame = self._frame(pair)
            if frame.t_capture > self._last:
                self._last = frame.t_capture
                self.age = self._clock() - frame.t_capture
                return frame

    def _frame(self, pair: Any) -> RgbdFrame:
        colour, depth = pair[COLOUR], pair[DEPTH]
        # The middle of the exposure, where the camera says how long it was, on DepthAI's clock of the host.
        taken = colour.getTimestamp(dai.CameraExposureOffset.MIDDLE)
        age = (dai.Clock.now() - taken).total_seconds()
        t_capture = self._clock() - age
        lens = colour.getTransformation()
        if not lens.isValid():
            raise OakLost("its calibration cannot be read")
        matrix = np.array(lens.getIntrinsicMatrix())
        picture = cv2.cvtColor(colour.getCvFrame(), cv2.COLOR_BGR2RGB)
        distances = depth.getFrame()
        if distances.dtype != np.uint16 or distances.shape != picture.shape[:2]:
            raise OakLost(f"depth of {distances.shape} is not aligned to colour of {picture.shape[:2]}")
        camera = Intrinsics(*(float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2))))
        return RgbdFrame(t_capture, distances, camera, picture)
