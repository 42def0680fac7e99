"""A recorded session as the teleop loop's `HandSource`: its packets go the same way as those of a headset."""

from collections.abc import Callable, Sequence

from ik_client.types import Hands
from xr_client.recording import Recorded
from xr_client.tracker import Tracker


class Replay:
    """Feeds a tracker with what was recorded. Time begins with the first tick in which the robot is ready."""

    def __init__(
        self,
        recording: Sequence[Recorded],
        tracker: Tracker | None = None,
        ready: Callable[[], bool] = lambda: True,
    ) -> None:
        """Prepare.

        Args:
            recording: What to play, in order of arrival, at least one packet.
            tracker: What to feed; None for one with the default reference.
            ready: Whether the robot would follow; asked until it is.
        """
        self.tracker = tracker or Tracker()
        self._recording = recording
        self._ready = ready
        self._next = 0
        self._begin: float | None = None

    @property
    def length(self) -> float:
        """How long it lasts [s]."""
        return self._recording[-1].time

    @property
    def finished(self) -> bool:
        """Whether the last packet has been fed and the tracker disconnected."""
        return self._next > len(self._recording)

    def hands(self, now: float) -> Hands | None:
        """What the recorded operator's hands do now; None before the beginning and after the end."""
        if self._begin is None:
            if not self._ready():
                return None
            self._begin = now
            self.tracker.connect()
        while self._next < len(self._recording) and self._begin + self._recording[self._next].time <= now:
            recorded = self._recording[self._next]
            self.tracker.feed(recorded.packet, self._begin + recorded.time)
            self._next += 1
        if self._next == len(self._recording) and now - self._begin > self.length:
            self.tracker.disconnect()
            self._next += 1
        return self.tracker.hands(now)
