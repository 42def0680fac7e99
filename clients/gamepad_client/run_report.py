"""What a run of `ik-gamepad` did: told while it goes on, summed up at the end, written for programs."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ik_client.rate_types import RateReport
from ik_client.run_record import RunRecord
from ik_client.stage_latencies import StageLatencies
from ik_client.state_machine import ArmState
from ik_proto import Array

STAGES = {"service": "twists asked to velocities answered", "command": "sticks read to command sent"}

_BRAKING_S = 0.5
"""Time to come to rest from any motion, and to spare [s]."""


class RunReport(RunRecord):
    """Takes in every tick.

    Attributes:
        moving: Ticks in which the arms followed.
        failures: Ticks in which they were engaged, and an answer did not come or could not be used.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Start empty.

        Args:
            clock: Monotonic time, the loop's [s].
        """
        super().__init__(StageLatencies(STAGES, clock), clock)
        self.moving = self.failures = 0
        self._state = ArmState.DISARMED
        self._reason = ""
        self._moved = -np.inf
        self._last: Array | None = None

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
        yield from self.summary("the arms", self.moving)

    def document(self) -> dict[str, Any]:
        """All of it, JSON-ready; latencies in milliseconds."""
        return super().document() | {"moving": self.moving, "failures": self.failures}
