"""The stages of the way from a hand to the robot, and of the picture on its way back: what each of them takes.

| stage     | from                                 | to                                       | a sample for        |
|-----------|--------------------------------------|------------------------------------------|---------------------|
| `headset` | capture of a pose                    | its arrival                              | each packet         |
| `wait`    | its arrival                          | the tick that used it                    | each pose used      |
| `service` | asked                                | answered                                 | each solve          |
| `command` | capture of a pose                    | command sent                             | each pose used      |
| `video`   | taking of an image                   | the page's word that it was shown        | each image shown    |

A page's times are told by its clock as `page_clock` estimates it, right to half a round trip; while that is not known,
there is no sample. In a replay there is no page: `command` counts from arrival, and `headset` has no samples.
"""

import time
from collections.abc import Callable

from ik_client.stage_latencies import StageLatencies
from ik_client.tick_report import TickReport
from xr_client.tracker import Arrival

STAGES = {
    "headset": "capture to arrival",
    "wait": "arrival to the tick",
    "service": "asked to answered",
    "command": "pose to command",
    "video": "taken to shown",
}

AgeMs = Callable[[float, float], float | None]
"""How old something is [ms] that a page says it saw at a time [ms, the page's], at one of ours [s]; None: not known."""


class Stages(StageLatencies):
    """The latencies of a run."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start without a sample.

        Args:
            clock: Monotonic time, the teleop loop's own [s].
        """
        super().__init__(STAGES, clock)

    def observe(self, report: TickReport, used: Arrival | None, age_ms: AgeMs | None) -> None:
        """Take a tick, as soon as its command has been sent.

        Args:
            report: What it did.
            used: The packet it used; one that an earlier tick has used gives no sample.
            age_ms: Tells a capture's age; None counts from arrival.
        """
        now = self._clock()
        if report.round_trip is not None:
            self["service"].add(1e3 * report.round_trip)
        if used is None or not self.first_use(used):
            return
        self["wait"].add(1e3 * (report.time - used.time))
        age = 1e3 * (now - used.time) if age_ms is None else age_ms(used.packet.capture_ms, now)
        if age is not None:
            self["command"].add(age)
