"""All the pictures a run was asked for, rendered one after the other with a progress bar."""

from collections.abc import Callable, Iterable, Sequence

import imageio.v3 as iio
from rich.console import Console
from rich.progress import track

from ik_proto.robots import RobotDescription
from sim_client.eyes import write_eyes
from sim_client.gl import NoRendering
from sim_client.render import Stage
from sim_client.settings import Settings
from sim_client.trace import Tick
from sim_client.video import strip, write_video


def write_pictures(
    settings: Settings,
    description: RobotDescription,
    ticks: Sequence[Tick],
    console: Console,
    say: Callable[[str], None],
) -> None:
    """Write still, film and stereo pictures, whichever were asked for.

    Args:
        settings: Names the files.
        description: The robot of the run.
        ticks: The run.
        console: For the progress bar.
        say: Told each file written, or in one line why there are none.
    """
    if not ticks or not (settings.still or settings.video or settings.eyes):
        return
    try:
        stage = Stage(description)
    except NoRendering as fault:
        say(str(fault))
        return
    with stage:
        if settings.still:
            settings.still.parent.mkdir(parents=True, exist_ok=True)
            iio.imwrite(settings.still, strip(stage, ticks))
            say(f"wrote {settings.still}")
        if settings.video:
            frames = write_video(settings.video, stage, ticks, _bar("film", console))
            say(f"wrote {settings.video}, {frames} frames")
        if settings.eyes and not stage.has_eyes:
            say(f"no stereo pictures: {description.name} has no cameras left_eye and right_eye")
        elif settings.eyes:
            pairs = write_eyes(settings.eyes, stage, ticks, _bar("eyes", console))
            say(f"wrote {pairs} stereo pairs to {settings.eyes}")


def _bar(name: str, console: Console) -> Callable[[Sequence[int]], Iterable[int]]:
    """A progress bar on a terminal, nothing elsewhere."""
    return lambda places: track(places, name, console=console, disable=not console.is_terminal, transient=True)
