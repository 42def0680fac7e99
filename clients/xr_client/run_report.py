"""What a run of `ik-xr` did: that of its loop, and the packets that came."""

from typing import Any

from ik_client.loop_report import LoopReport
from xr_client.stages import Stages
from xr_client.tracker import Tracker


class RunReport(LoopReport):
    """Takes in every tick."""

    stages: Stages

    def __init__(self, stages: Stages, tracker: Tracker) -> None:
        """Start empty.

        Args:
            stages: Latencies; filled by others.
            tracker: Counts packets.
        """
        super().__init__(stages)
        self._tracker = tracker

    def document(self) -> dict[str, Any]:
        """All of it, JSON-ready; latencies in milliseconds, packets those of the last connection."""
        order = self._tracker.order
        return super().document() | {
            "connections": self._tracker.connections,
            "packets": {"accepted": order.accepted, "dropped": order.dropped, "missed": order.missed},
        }
