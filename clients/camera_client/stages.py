"""The stages of the way from the light to the robot, and what each of them takes.

| stage       | from                                  | to                                        | a sample for     |
|-------------|---------------------------------------|-------------------------------------------|------------------|
| `camera`    | the light falls in                    | the frame is here                         | each frame       |
| `landmarks` | the frame is here                     | the pose model has answered               | each frame       |
| `lift`      | the pose model has answered           | depths are on the viewing rays            | each body lifted |
| `filter`    | depths are on the viewing rays        | both arms are estimated                   | each body lifted |
| `wait`      | both arms are estimated               | the tick of the loop that uses them first | each frame used  |
| `ik`        | the service is asked                  | it has answered                           | each solve       |
| `command`   | the frame is here                     | the command that uses it first is sent    | each frame used  |
| `whole`     | the light falls in                    | the command that uses it first is sent    | each frame used  |

A tick uses what is predicted to its own time, so `wait` costs freshness of what the camera saw, not truth of when.
"""

import time
from collections.abc import Callable

from camera_client.tracker import Look
from ik_client.stage_latencies import StageLatencies
from ik_client.tick_report import TickReport

STAGES = {
    "camera": "capture to frame here",
    "landmarks": "frame to landmarks",
    "lift": "landmarks to depths",
    "filter": "depths to arms",
    "wait": "arms to the tick",
    "ik": "asked to answered",
    "command": "frame here to command",
    "whole": "capture to command",
}


class Stages(StageLatencies):
    """The latencies of a run. Frames come from one thread, ticks from another."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start without a sample.

        Args:
            clock: Monotonic time, the teleop loop's own [s].
        """
        super().__init__(STAGES, clock)

    def seen(self, look: Look, found: float, lifted: float | None) -> None:
        """Take a frame.

        Args:
            look: What became of it.
            found: When the pose model had answered [s].
            lifted: When depths were on the rays [s]; None where nothing was lifted.
        """
        self["camera"].add(1e3 * (look.received - look.captured))
        self["landmarks"].add(1e3 * (found - look.received))
        if lifted is not None:
            self["lift"].add(1e3 * (lifted - found))
            self["filter"].add(1e3 * (look.ready - lifted))

    def observe(self, report: TickReport, used: Look | None) -> None:
        """Take a tick, as soon as its command has been sent.

        Args:
            report: What it did.
            used: The look it used; one that an earlier tick has used gives no sample.
        """
        now = self._clock()
        if report.round_trip is not None:
            self["ik"].add(1e3 * report.round_trip)
        if used is None or not self.first_use(used):
            return
        self["wait"].add(1e3 * (report.time - used.ready))
        self["command"].add(1e3 * (now - used.received))
        self["whole"].add(1e3 * (now - used.captured))
