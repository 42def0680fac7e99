"""What a run of `ik-camera` did: that of its loop, and what the camera saw."""

from typing import Any

from camera_client.perception import Perception
from camera_client.stages import Stages
from camera_client.tracker import CameraTracker
from ik_client.loop_report import LoopReport


class RunReport(LoopReport):
    """Takes in every tick."""

    stages: Stages

    def __init__(self, stages: Stages, tracker: CameraTracker, perception: Perception, about: dict[str, Any]) -> None:
        """Start empty.

        Args:
            stages: Latencies; filled by others.
            tracker: Has the latest look.
            perception: Counts frames.
            about: What was run, JSON-ready.
        """
        super().__init__(stages)
        self._tracker, self._perception, self._about = tracker, perception, about

    def document(self) -> dict[str, Any]:
        """All of it, JSON-ready; latencies in milliseconds, when the first frame was captured in seconds."""
        look = self._tracker.latest
        frames: dict[str, Any] = {"seen": self._perception.frames, "with_a_body": self._perception.bodies}
        frames["first"] = self._perception.first
        frames["of_somebody_else"] = 0 if look is None else look.refused
        return self._about | super().document() | {"frames": frames, "fault": self._perception.fault}
