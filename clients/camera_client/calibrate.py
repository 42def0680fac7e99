"""`ik-camera calibrate`: a countdown, two seconds of a T pose, and a file under the user's name.

What is missing is said while it is missing, so that one can put it right without coming to the keyboard.
"""

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from camera_client.calibration import CalibrationError, default_folder, save
from camera_client.frame import RgbdFrame
from camera_client.landmarks import Landmarks
from camera_client.setup import detector_of
from camera_client.source import DEFAULT_FIELD_OF_VIEW, FrameSource, open_source
from camera_client.t_pose import DURATION, LEAST_FRAMES, TPose
from ik_client.start import SettingsError

_PATIENCE = 30.0
"""How long a T pose is waited for [s]."""
_SETTLING, _GAP = 0.5, 0.3
"""Time in which the arms come to rest; and for which a pose may be missed without beginning anew [s]."""
_SAY_AGAIN = 2.0
"""Time after which the same thing is said again [s]."""

Detect = Callable[[NDArray[np.uint8], float], Landmarks | None]


def calibrate(
    user: str,
    say: Callable[[str], None],
    keep_going: Callable[[], bool],
    *,
    source: str = "oak",
    replay: Path | None = None,
    model: str = "full",
    field_of_view: float | None = None,
    countdown: float = 5.0,
    folder: Path | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Path:
    """Fit an operator and keep the fit.

    Args:
        user: The name to keep it under.
        say: Tells a person a line.
        keep_going: Asked all the time.
        source: The camera, as `open_source` takes it.
        replay: A recording instead of it, which needs no countdown.
        model: Name or path of the pose model.
        field_of_view: Of a webcam [deg].
        countdown: Time to take the pose [s].
        folder: Where to keep it; None for the usual place.
        clock: Monotonic time [s].

    Returns:
        The file.

    Raises:
        ValueError: Source, model or name cannot be used, or what was seen is no T pose.
    """
    if not 0.0 <= countdown <= 60.0:
        raise SettingsError(f"--countdown {countdown:g}: must be from 0 to 60 seconds")
    folder = folder or default_folder()
    view = DEFAULT_FIELD_OF_VIEW if field_of_view is None else math.radians(field_of_view)
    with contextlib.ExitStack() as stack:
        what = source if replay is None else str(replay)
        camera = stack.enter_context(contextlib.closing(open_source(what, field_of_view=view)))
        if not camera.has_depth:
            raise SettingsError(f"{camera.description} measures no depth, and cannot measure you: use a depth camera")
        detector = stack.enter_context(contextlib.closing(detector_of(model, say)))
        say(f"{camera.description}: stand 2 to 4 m before it, and stretch both arms out to the sides")
        frames = _frames(camera, keep_going, clock)
        if replay is None:
            _count_down(frames, countdown, say, clock)
        fitted = _hold(frames, detector.detect, say, clock).finish()
    path = save(fitted, user, folder)
    upper, fore = fitted.lengths[0].tolist()
    tilt = math.degrees(math.atan2(-fitted.up_camera[2], -fitted.up_camera[1]))
    say(f"upper arm {100 * upper:.0f} cm, forearm {100 * fore:.0f} cm; the camera looks down by {tilt:.0f} degrees")
    say(f"kept as {path}: ik-camera --user {user}")
    return path


def _hold(frames: Iterator[RgbdFrame], detect: Detect, say: Callable[[str], None], clock: Callable[[], float]) -> TPose:
    """Collect a T pose that is held for long enough; it begins anew when it is left."""
    pose, settled = TPose(), False
    first = last = math.nan
    said, when, begin = "", -math.inf, clock()
    for frame in frames:
        assert frame.colour is not None, "sources give colour"
        t, now = frame.t_capture, clock()
        if pose.add(frame, detect(frame.colour, t)):
            if pose.good == 1 and not settled:
                first, said = t, ""
                say("hold still ...")
            if not settled and t - first >= _SETTLING:
                # The arms have come to rest by now; how they came there does not count.
                pose, settled, first = TPose(), True, t
            last = t
            if settled and pose.good >= LEAST_FRAMES and t - first >= DURATION:
                return pose
        else:
            if t - last > _GAP:
                pose, settled, last = _anew(pose), False, math.nan
            if pose.fault != said or now - when > _SAY_AGAIN:
                said, when = pose.fault, now
                say(said)
        if now - begin > _PATIENCE:
            raise CalibrationError(f"no T pose within {_PATIENCE:.0f} s: {pose.fault or 'hold still for longer'}")
    return pose


def _anew(pose: TPose) -> TPose:
    """A fresh one that still says what was wrong."""
    fresh = TPose()
    fresh.fault = pose.fault
    return fresh


def _frames(camera: FrameSource, keep_going: Callable[[], bool], clock: Callable[[], float]) -> Iterator[RgbdFrame]:
    """Frames as they come.

    Raises:
        CalibrationError: None come any more, or the person has ended it.
    """
    last = clock()
    while not camera.finished:
        if not keep_going():
            raise CalibrationError("ended before the T pose was seen: nothing was kept")
        frame = camera.next(0.1)
        if frame is not None:
            last = clock()
            yield frame
        elif clock() - last > _PATIENCE:
            raise CalibrationError(camera.fault or "the camera gives no frames")


def _count_down(
    frames: Iterator[RgbdFrame], countdown: float, say: Callable[[str], None], clock: Callable[[], float]
) -> None:
    end, left = clock() + countdown, math.ceil(countdown)
    for _ in frames:
        rest = end - clock()
        if rest <= 0.0:
            return
        if rest <= left:
            say(f"{left} ...")
            left -= 1
