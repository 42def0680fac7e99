"""Stereo pictures of a run, as the robot's eyes see it: numbered PNG pairs."""

from collections.abc import Sequence
from pathlib import Path

import imageio.v3 as iio

from sim_client.render import EYE, Stage
from sim_client.trace import Tick
from sim_client.video import Progress

TICKS_PER_PAIR = 10
"""One pair every so many ticks: five pairs a second."""


def write_eyes(folder: Path, stage: Stage, ticks: Sequence[Tick], progress: Progress = iter) -> int:
    """Write `left_NNNNNN.png` and `right_NNNNNN.png`, numbered by tick.

    Args:
        folder: Made if need be.
        stage: Renders; its robot has eyes.
        ticks: The run.
        progress: Wraps the pairs.

    Returns:
        Number of pairs.

    Raises:
        ValueError: The robot's model has no eye cameras.
    """
    folder.mkdir(parents=True, exist_ok=True)
    shown = range(0, len(ticks), TICKS_PER_PAIR)
    for place in progress(shown):
        tick = ticks[place]
        pair = stage.stereo(tick)
        iio.imwrite(folder / f"left_{tick.index:06d}.png", pair[:, : EYE[0]])
        iio.imwrite(folder / f"right_{tick.index:06d}.png", pair[:, EYE[0] :])
    return len(shown)
