"""A film of a run, and a strip of stills from it."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import imageio.v3 as iio
import numpy as np

from sim_client.offscreen import Image
from sim_client.render import Stage
from sim_client.robot import CONTROL_PERIOD
from sim_client.trace import Tick
from sim_client.trails import TRAIL_TICKS

TICKS_PER_FRAME = 2
FRAME_RATE = round(1.0 / (TICKS_PER_FRAME * CONTROL_PERIOD))
"""Frames per second of a film, in simulated time."""

STILL_WIDTH = 640
"""Width of one still of a strip [pixel]."""

Progress = Callable[[Sequence[int]], Iterable[int]]
"""Passes indices through, and shows how far it is."""


def write_video(path: Path, stage: Stage, ticks: Sequence[Tick], progress: Progress = iter) -> int:
    """Render a film in H.264.

    Args:
        path: The .mp4 file; folders are made.
        stage: Renders.
        ticks: The run.
        progress: Wraps the frames.

    Returns:
        Number of frames.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    shown = range(0, len(ticks), TICKS_PER_FRAME)
    with iio.imopen(path, "w", plugin="pyav") as film:
        film.init_video_stream("libx264", fps=FRAME_RATE)
        for index in progress(shown):
            film.write_frame(stage.view(_until(ticks, index)))
    return len(shown)


def strip(stage: Stage, ticks: Sequence[Tick], count: int = 3) -> Image:
    """Stills of a run side by side, evenly spaced and ending before its end.

    Args:
        stage: Renders.
        ticks: The run, at least one tick.
        count: How many stills.

    Returns:
        One picture.
    """
    places = np.linspace(0.3, 0.95, count) * (len(ticks) - 1)
    return np.hstack([stage.view(_until(ticks, int(place)), STILL_WIDTH) for place in places])


def _until(ticks: Sequence[Tick], index: int) -> Sequence[Tick]:
    """A tick and those before it that its picture shows."""
    return ticks[max(index + 1 - TRAIL_TICKS, 0) : index + 1]
