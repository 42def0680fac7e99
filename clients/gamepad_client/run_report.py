"""What a run of `ik-gamepad` did: told while it goes on, summed up at the end, written for programs."""

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ik_client.latency import Latency
from ik_client.pacer import Pacer
from ik_client.rate_types import RateReport
from ik_client.stage_latencies import StageLatencies
from ik_client.state_machine import ArmState
from ik_proto import Array

STAGES = {"service": "twists asked to velocities answered", "command": "sticks read to command sent"}

_BRAKING_S = 0.5
"""Time to come to rest from any motion, and to spare [s]."""


class RunReport:
    """Takes in every tick.

    Attributes:
        stages: Latencies of the way.
        lateness: How long after they were due ticks began.
        ticks: Ticks of the loop.
        moving: Ticks in which the arms followed.
        engagements: How often the arms were engaged.
        failures: Ticks in which they were engaged, and an answer did not come or could not be used.
        late: Ticks that began more than a period late.
        step_at_rest: Largest step in a tick of the commands to arms that had not followed for half a second [rad].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start empty.

        Args:
            clock: Monotonic time, the loop's [s].
        """
        self.stages = StageLatencies(STAGES, clock)
        self.lateness = Latency(clock)
        self.ticks = self.moving = self.engagements = self.failures = self.late = 0
        self.step_at_rest = 0.0
        self._state = ArmState.DISARMED
        self._reason = ""
        self._moved = -np.inf
        self._last: Array | None = None

    def paced(self, pacer: Pacer) -> None:
        """Take how late the tick begins that is about to."""
        self.lateness.add(1e3 * pacer.behind)
        self.late = pacer.late

    def observe(self, report: RateReport) -> list[str]:
        """Take a tick; give what has changed, a line each."""
        changed = (report.state, report.reason) != (self._state, self._reason)
        told = report.state is not self._state or (changed and report.state is ArmState.DISARMED)
        self.engagements += report.state is ArmState.ACTIVE and self._state is not ArmState.ACTIVE
        self._state, self._reason = report.state, report.reason
        self.ticks += 1
        self.moving += report.moving
        self.failures += report.state is ArmState.ACTIVE and not report.moving
        if report.round_trip is not None:
            self.stages["service"].add(1e3 * report.round_trip)
        if report.moving:
            self.stages["command"].add(1e3 * (report.sent - report.time))
        self._watch(report)
        return [f"{report.state}{f', {report.reason}' if report.reason else ''}"] if told else []

    def _watch(self, report: RateReport) -> None:
        q, now = report.command.q, report.command.time
        if report.moving:
            self._moved = now
        # Before the first engagement the commands are wherever the robot's end holds its joints.
        if self.engagements and self._last is not None and now - self._moved > _BRAKING_S:
            self.step_at_rest = max(self.step_at_rest, float(np.abs(q - self._last).max()))
        self._last = q

    def lines(self) -> Iterator[str]:
        """The summary for a person."""
        yield (
            f"{self.ticks} ticks, {self.late} of them late; {self.engagements} engagements, "
            f"the arms followed in {self.moving / max(self.ticks, 1):.0%} of the time"
        )
        yield from self.stages.table()

    def document(self) -> dict[str, Any]:
        """All of it, JSON-ready; latencies in milliseconds."""
        lateness = self.lateness.summary()
        return {
            "ticks": self.ticks,
            "late": self.late,
            "lateness_ms": asdict(lateness) if lateness else None,
            "moving": self.moving,
            "engagements": self.engagements,
            "failures": self.failures,
            "step_at_rest": self.step_at_rest,
            "stages_ms": self.stages.document(),
        }

    def write(self, path: Path) -> None:
        """Write the document as JSON."""
        path.write_text(json.dumps(self.document(), indent=2) + "\n", encoding="utf-8")
