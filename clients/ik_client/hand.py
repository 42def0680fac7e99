"""What a tracker says about one hand.

A tracker vouches for nothing but what it saw. Whether a sample is good enough to move a robot, the gate decides.
"""

from dataclasses import dataclass

from ik_proto import Array


@dataclass(frozen=True, slots=True, eq=False)
class HandSample:
    """One look at one hand of the operator.

    Attributes:
        pose: The hand in any frame that stands still and has the axes of the robot's pelvis frame (x forward, y left,
            z up), shape (4, 4) [m].
        grip: Whether the operator holds the hold-to-run switch; None where the tracker cannot tell.
        stamp: The sender's time or count. It only tells two samples apart and is never compared with a clock: the
            clocks of two machines disagree.
        tracked: Whether the tracker sees the hand rather than guesses it.
    """

    pose: Array
    grip: bool | None
    stamp: float
    tracked: bool = True
