"""As in a mirror: the robot's left arm does what the operator's right arm does.

    S = diag(1, -1, 1),    p' = S p,    R' = S R S

The picture itself is never flipped: a pose model tells left from right by it. R' is a rotation again, as S goes into it
twice.
"""

from dataclasses import replace

import numpy as np

from camera_client.estimate import ArmsEstimate

_S = np.array([1.0, -1.0, 1.0])


def mirrored(estimate: ArmsEstimate) -> ArmsEstimate:
    """The arms of the operator's mirror image."""
    return replace(
        estimate,
        tracked=estimate.tracked[::-1],
        joints=_S * estimate.joints[::-1],
        velocity=_S * estimate.velocity[::-1],
        limbs=_S * estimate.limbs[::-1],
        R_pelvis_wrist=_S[:, None] * estimate.R_pelvis_wrist[::-1] * _S,
        confidence=estimate.confidence[::-1],
        bend=estimate.bend[::-1],
        elbow_confidence=estimate.elbow_confidence[::-1],
        yaw=-estimate.yaw,
    )
