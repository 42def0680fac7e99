"""The operator's arms as wrist targets: estimates in from the camera's thread, hands out to the teleop loop's.

    perception   feed, feed, ...        a frame and what became of it; the latest wins
    loop         hands, hands, ...      prediction to when the command will count ─> mirror ─> straight arms
                                        ─> out of the robot's body ─> the robot's size

- Both arms have one hold-to-run switch. Where it is not known whether it is held, the hands are lost for that tick.
- A frame that is older than `OLDEST` is no look at anybody: both hands are lost. So it does not matter whether camera,
  model or machine has stopped.
- An arm that is out of view, or whose place is known to no better than a decimetre, is lost.
- Times are those of the loop's clock.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from camera_client.approach import Approach, Stage
from camera_client.clear_arms import ClearArms
from camera_client.estimate import ArmsEstimate
from camera_client.frame import RgbdFrame
from camera_client.landmarks import Landmarks
from camera_client.mirror import mirrored
from camera_client.prediction import predicted
from camera_client.scaling import RobotArms, elbow_hints, wrist_positions
from camera_client.straight_arms import straightened
from ik_client.hand import HandSample
from ik_client.types import Hands

OLDEST = 0.25
"""Age of a frame's capture beyond which its arms are not followed [s]."""
LEAST_CONFIDENCE = 0.05
"""Confidence in a wrist's position below which it is not followed."""

Switch = Callable[[float], bool | None]
"""Says whether the hold-to-run switch is held at a time [s]; None where that is not known."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What became of a frame. Replaced as a whole, so that no thread sees half of one.

    Attributes:
        frame: What the camera saw.
        landmarks: What the pose model found in it; None for nobody.
        estimate: Both arms; None before the first body.
        captured: When the light fell in [s].
        received: When the frame came [s].
        ready: When the estimate was there [s].
        held: Whether a recorded switch was held with this frame; None where there is no telling.
        refused: Frames with somebody else's body so far.
    """

    frame: RgbdFrame
    landmarks: Landmarks | None
    estimate: ArmsEstimate | None
    captured: float
    received: float
    ready: float
    held: bool | None = None
    refused: int = 0


@dataclass(slots=True)
class CameraTracker:
    """A camera as the teleop loop's `HandSource`.

    Attributes:
        robot: Whose wrists, with its waist as it stands; may be replaced from the loop's thread.
        switch: The hold-to-run switch; None takes the one that was recorded with the frames.
        approaches: Of the left and the right arm; one that goes home shows no elbow.
        lead: How long after the tick its command counts [s].
        mirror: Whether the robot is the operator's mirror image.
        clear: Turns forearms out of the robot's body; None leaves that to the solver.
        latest: The latest look.
        used: The look that the loop used last.
    """

    robot: RobotArms
    switch: Switch | None = None
    approaches: tuple[Approach, Approach] | None = None
    lead: float = 0.0
    mirror: bool = False
    clear: ClearArms | None = None
    latest: Look | None = field(default=None, init=False)
    used: Look | None = field(default=None, init=False)

    def feed(self, look: Look) -> None:
        """Take a look."""
        self.latest = look

    def hands(self, now: float) -> Hands | None:
        """What the operator's arms do, for a tick of the loop; None before anybody was seen."""
        look = self.used = self.latest
        if look is None or look.estimate is None:
            return None
        held = self.held(now)
        arms = self._arms(look.estimate, now - look.captured)
        seen = arms.tracked & (arms.confidence >= LEAST_CONFIDENCE)
        seen &= held is not None and 0.0 <= now - look.captured <= OLDEST
        poses = np.tile(np.eye(4), (2, 1, 1))
        limbs, R_pelvis_wrist = straightened(arms.limbs, arms.R_pelvis_wrist, self.robot.upper, self.robot.fore)
        hints = elbow_hints(limbs, arms.elbow_confidence, self.robot)
        if self.clear is not None:
            limbs, R_pelvis_wrist = self.clear(limbs, R_pelvis_wrist, self.robot)
        poses[:, :3, :3], poses[:, :3, 3] = R_pelvis_wrist, wrist_positions(limbs, self.robot)
        left, right = (
            HandSample(pose, held, look.captured, bool(there)) for pose, there in zip(poses, seen, strict=True)
        )
        elbows = [None if self._goes_home(side) else hint for side, hint in enumerate(hints)]
        weights = arms.weights
        weights[[self._goes_home(side) for side in (0, 1)]] = 1.0
        return Hands(left, right, elbows[0], elbows[1], weights)

    def held(self, now: float) -> bool | None:
        """Whether the hold-to-run switch is held at a time [s]; None where that is not known."""
        if self.switch is not None:
            return self.switch(now)
        return None if self.latest is None else self.latest.held

    def trouble(self, now: float) -> str:
        """Why no arm can be followed, in one line; empty where one can."""
        look = self.latest
        if look is None:
            return "no frame yet"
        if now - look.captured > OLDEST:
            return f"no frame for {now - look.received:.1f} s"
        if look.estimate is None:
            return "nobody faces the camera"
        return look.estimate.note if not look.estimate.tracked.any() else ""

    def _arms(self, estimate: ArmsEstimate, age: float) -> ArmsEstimate:
        """The arms when the command counts, as the robot shall have them."""
        arms = predicted(estimate, estimate.t_capture + age + self.lead)
        return mirrored(arms) if self.mirror else arms

    def _goes_home(self, side: int) -> bool:
        return self.approaches is not None and self.approaches[side].stage is Stage.HOME
