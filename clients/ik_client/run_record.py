"""What a run of any client did, as far as it is the same for all: ticks and how late they were, and latencies."""

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ik_client.latency import Latency
from ik_client.pacer import Pacer
from ik_client.stage_latencies import StageLatencies


class RunRecord:
    """Counts ticks.

    Attributes:
        stages: Latencies of the way.
        lateness: How long after they were due ticks began.
        ticks: Ticks of the loop.
        engagements: How often an arm began to follow.
        late: Ticks that began more than a period late.
        step_at_rest: Largest step in a tick of the commands to an arm that had not followed for half a second [rad].
    """

    def __init__(self, stages: StageLatencies, clock: Callable[[], float] = time.monotonic) -> None:
        """Start empty.

        Args:
            stages: Latencies; filled by others.
            clock: Monotonic time [s].
        """
        self.stages = stages
        self.lateness = Latency(clock)
        self.ticks = 0
        self.engagements = 0
        self.late = 0
        self.step_at_rest = 0.0

    def paced(self, pacer: Pacer) -> None:
        """Take how late the tick begins that is about to."""
        self.lateness.add(1e3 * pacer.behind)
        self.late = pacer.late

    def summary(self, who: str, followed: int) -> Iterator[str]:
        """The summary for a person.

        Args:
            who: What followed.
            followed: In how many ticks.
        """
        yield (
            f"{self.ticks} ticks, {self.late} of them late; {self.engagements} engagements, "
            f"{who} followed in {followed / max(self.ticks, 1):.0%} of the time"
        )
        yield from self.stages.table()

    def document(self) -> dict[str, Any]:
        """All of it, JSON-ready; latencies in milliseconds."""
        lateness = self.lateness.summary()
        return {
            "ticks": self.ticks,
            "late": self.late,
            "lateness_ms": asdict(lateness) if lateness else None,
            "engagements": self.engagements,
            "step_at_rest": self.step_at_rest,
            "stages_ms": self.stages.document(),
        }

    def write(self, path: Path) -> None:
        """Write the document as JSON."""
        path.write_text(json.dumps(self.document(), indent=2) + "\n", encoding="utf-8")
