"""What a headset sees of its operator at one moment, in the robot's axes. The room it is seen in stands still."""

from dataclasses import dataclass

from ik_client.hand import HandSample
from ik_proto import Array


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """One look at the operator.

    Attributes:
        head: Head in the room, shape (4, 4) [m]: x forward, y left, z up; None where it is not tracked.
        left: Left wrist in the room; None where the headset says nothing of it.
        right: Right wrist in the room.
    """

    head: Array | None
    left: HandSample | None
    right: HandSample | None

    @property
    def wrists(self) -> tuple[HandSample | None, HandSample | None]:
        """Left and right."""
        return self.left, self.right
