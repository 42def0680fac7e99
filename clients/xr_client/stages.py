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
from dataclasses import asdict
from typing import Any

from ik_client.tick_report import TickReport
from xr_client.latency import Latency
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


class Stages:
    """The latencies of a run."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start without a sample.

        Args:
            clock: Monotonic time, the teleop loop's own [s].
        """
        self._stages = {name: Latency(clock) for name in STAGES}
        self._clock = clock
        self._used: Arrival | None = None

    def __getitem__(self, name: str) -> Latency:
        """The stage of a name."""
        return self._stages[name]

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
        if used is None or used is self._used:
            return
        self._used = used
        self["wait"].add(1e3 * (report.time - used.time))
        age = 1e3 * (now - used.time) if age_ms is None else age_ms(used.packet.capture_ms, now)
        if age is not None:
            self["command"].add(age)

    def recent(self) -> dict[str, float | None]:
        """Stages by name and what they took of late [ms]; None where there were no samples."""
        return {name: stage.recent_ms for name, stage in self._stages.items()}

    def document(self) -> dict[str, dict[str, Any]]:
        """All samples, JSON-ready: percentiles [ms] and their number, by stage; stages without samples left out."""
        summaries = {name: stage.summary() for name, stage in self._stages.items()}
        return {name: asdict(summary) for name, summary in summaries.items() if summary}

    def table(self) -> list[str]:
        """The same for a person, a line each; empty without samples."""
        rows = self.document()
        if not rows:
            return []
        columns = ("p50", "p95", "p99", "max")
        head = f"{'latency [ms]':<30}" + "".join(f"{name:>9}" for name in columns) + f"{'samples':>10}"
        lines = [
            f"{name:<9}{STAGES[name]:<21}" + "".join(f"{row[column]:9.2f}" for column in columns) + f"{row['n']:10d}"
            for name, row in rows.items()
        ]
        return [head, *lines]
