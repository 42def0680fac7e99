"""What the chain makes of a frame: both arms in the operator's pelvis frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ik_proto import Array

ORIENTATION_FLOOR = 0.2
"""Least factor on the weight of an orientation whose position is known: the forearm's direction is, even if no bend of
the elbow shows how it is turned about itself."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmsEstimate:
    """Both arms, left then right. Everything is in the operator's pelvis frame (x forward, y left, z up).

    An arm that is not tracked is where it was last seen.

    Attributes:
        t_capture: When the light fell in [s].
        tracked: Which arms are seen, shape (2,).
        joints: Shoulder, elbow and wrist, shape (2, 3, 3) [m]; limbs have the calibrated lengths.
        velocity: Of these joints against the pelvis, shape (2, 3, 3) [m/s]; zero for an arm that is not tracked.
        limbs: Unit directions of upper arm and forearm, shape (2, 2, 3).
        R_pelvis_wrist: Orientations of the wrists, shape (2, 3, 3).
        confidence: In the positions, 0 to 1, shape (2,).
        bend: How far the bend of the elbows shows the turn of the forearms, 0 to 1, shape (2,).
        elbow_confidence: In the elbows' directions, 0 to 1, shape (2,).
        yaw: How far the operator is turned to the left [rad].
        note: Why an arm is not tracked; empty where both are.
        monocular: Whether the camera measured no depth, so that all distances are the pose model's guess, about four
            times as far off.
    """

    t_capture: float
    tracked: NDArray[np.bool_]
    joints: Array
    velocity: Array
    limbs: Array
    R_pelvis_wrist: Array
    confidence: Array
    bend: Array
    elbow_confidence: Array
    yaw: float
    note: str = ""
    monocular: bool = False

    @property
    def weights(self) -> Array:
        """Factors on how much position and orientation of each wrist count, shape (2, 2), for `IKClient.solve`."""
        turned = ORIENTATION_FLOOR + (1.0 - ORIENTATION_FLOOR) * self.bend
        return np.stack([np.ones(2), turned * self.confidence], axis=1)
