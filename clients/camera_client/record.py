"""`ik-camera record`: what a camera sees, into a file; with the hold-to-run switch, if there is one."""

import contextlib
import math
import time
from collections.abc import Callable
from pathlib import Path

from camera_client.enable import Enable
from camera_client.recorder import Recorder
from camera_client.recording import RecordingError
from camera_client.source import open_source
from ik_client.devices import Devices, open_switch
from ik_client.start import SettingsError

_SAY_EVERY = 5.0
"""How often it is told how much there is [s]."""


def record(
    file: Path,
    say: Callable[[str], None],
    keep_going: Callable[[], bool],
    *,
    source: str = "oak",
    duration: float = math.inf,
    enable: list[str] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> int:
    """Record until told to end, or for a time.

    Args:
        file: Where to; there must be none yet.
        say: Tells a person a line.
        keep_going: Asked all the time.
        source: The camera, as `open_source` takes it.
        duration: How long [s].
        enable: Switches to record too, as `open_switch` takes them.
        clock: Monotonic time [s].

    Returns:
        How many frames there are.

    Raises:
        ValueError: Source, switch or file cannot be used.
    """
    if not duration > 0.0:
        raise SettingsError(f"--duration {duration:g}: must be a positive number of seconds")
    with contextlib.ExitStack() as stack:
        camera = stack.enter_context(contextlib.closing(open_source(source)))
        devices, switch = None, None
        if enable:
            window = (480, 120) if any(spec.startswith("key:") for spec in enable) else None
            devices = stack.enter_context(Devices(window, f"ik-camera record {file.name}"))
            switch = Enable([open_switch(spec, devices) for spec in enable])
        recorder = stack.enter_context(contextlib.closing(Recorder(file, camera.description)))
        say(f"{camera.description} into {file}; Ctrl-C ends it")
        begin = told = clock()
        while keep_going() and not camera.finished and clock() - begin < duration and not recorder.fault:
            frame = camera.next(0.05)
            now = clock()
            held = None
            if devices is not None and switch is not None:
                devices.pump()
                switch.read(now)
                held = switch.held(now)
                if devices.closed:
                    break
            if frame is not None:
                recorder.write(frame, held)
            if now - told > _SAY_EVERY:
                told = now
                say(f"{recorder.written} frames, {now - begin:.0f} s{_dropped(recorder)}")
    if recorder.fault:
        raise RecordingError(recorder.fault)
    if recorder.written == 0:
        file.unlink(missing_ok=True)
        raise RecordingError(f"{camera.fault or 'the camera gave no frame'}: nothing was recorded")
    say(f"{recorder.written} frames in {file}{_dropped(recorder)}")
    return recorder.written


def _dropped(recorder: Recorder) -> str:
    return f", {recorder.dropped} dropped: the disk is too slow" if recorder.dropped else ""
