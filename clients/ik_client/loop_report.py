"""What a run of a client with a teleop loop did: told while it goes on, summed up at the end, written for programs."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ik_client.arm_joints import SIDES, joints_of
from ik_client.run_record import RunRecord
from ik_client.stage_latencies import StageLatencies
from ik_client.state_machine import ArmState
from ik_client.tick_report import TickReport
from ik_proto import Array

_BRAKING_TICKS = 25
"""Time to come to rest from any motion, and to spare [ticks]."""


class LoopReport(RunRecord):
    """Takes in every tick.

    Attributes:
        active: Ticks in which an arm followed a hand.
    """

    def __init__(self, stages: StageLatencies) -> None:
        """Start empty.

        Args:
            stages: Latencies; filled by others.
        """
        super().__init__(stages)
        self.active = 0
        self._resting = [0, 0]
        self._command: Array | None = None
        self._states = (ArmState.DISARMED, ArmState.DISARMED)

    def observe(self, report: TickReport) -> list[str]:
        """Take a tick; give what has changed, a line each."""
        changed = [
            (name, arm)
            for name, arm, before in zip(SIDES, report.arms, self._states, strict=True)
            if arm.state is not before
        ]
        self._states = (report.arms[0].state, report.arms[1].state)
        self.ticks += 1
        self.active += ArmState.ACTIVE in self._states
        self.engagements += sum(arm.state is ArmState.ACTIVE for _, arm in changed)
        self._watch_rest(report.command.q)
        return [f"{name} arm: {arm.state}" + (f", {arm.reason}" if arm.reason else "") for name, arm in changed]

    def _watch_rest(self, q: Array) -> None:
        for side, state in enumerate(self._states):
            self._resting[side] = 0 if state is ArmState.ACTIVE else self._resting[side] + 1
            # Before the first grip the commands are wherever the robot's end holds its joints, and move with them.
            if self.engagements and self._command is not None and self._resting[side] > _BRAKING_TICKS:
                arm = joints_of(side, len(q))
                step = float(np.abs(q[arm] - self._command[arm]).max())
                self.step_at_rest = max(self.step_at_rest, step)
        self._command = q

    def lines(self) -> Iterator[str]:
        """The summary for a person."""
        yield from self.summary("an arm", self.active)

    def document(self) -> dict[str, Any]:
        """All of it, JSON-ready; latencies in milliseconds."""
        return super().document() | {"active": self.active}
