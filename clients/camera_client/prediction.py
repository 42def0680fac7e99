"""Carries the arms of a frame on to now: the picture is old by what exposure, transfer and the pose model took.

    p(now) = p + v s tau (1 - exp(-age / tau)),    age = now - capture,    s = v² / (v² + STILL²)

A velocity is good for a short time only, so it dies away with tau, and nothing is predicted beyond `FARTHEST` or by an
arm that is held or poorly seen. What hardly moves is taken to stand still: the rest is noise, which predicting would
make more of. Limbs keep their lengths, and the wrist turns with its forearm.
"""

import math
from dataclasses import replace

import numpy as np

from camera_client.estimate import ArmsEstimate
from camera_client.vectors import length, transport, unit

TAU = 0.12
"""Time constant of a velocity [s]."""
FARTHEST = 0.15
"""Greatest age that is made up for [s]."""
FASTEST = 3.0
"""Bound on a joint's speed against the pelvis [m/s]."""
STILL = 0.15
"""Speed of which half counts; slower motion counts less, faster motion more [m/s]."""
TRUSTED = 0.5
"""Confidence from which on an arm is predicted in full; it is not at all below half of that."""


def predicted(estimate: ArmsEstimate, now: float) -> ArmsEstimate:
    """The arms as they are now, as far as can be told.

    Args:
        estimate: The arms of a frame.
        now: The time to predict [s], by the clock of the frame's capture.

    Returns:
        A copy with predicted joints, limbs and orientations; the same where there is nothing to predict.
    """
    age = min(max(now - estimate.t_capture, 0.0), FARTHEST)
    if age == 0.0:
        return estimate
    horizon = TAU * (1.0 - math.exp(-age / TAU))
    full = length(estimate.velocity)
    speed = np.minimum(full, FASTEST)
    trust = (2.0 * estimate.confidence / TRUSTED - 1.0).clip(0.0, 1.0) * estimate.tracked
    moves = speed**2 / (speed**2 + STILL**2)
    factor = horizon * trust[:, None] * moves * speed / np.maximum(full, 1e-9)
    moved = estimate.joints + factor[..., None] * estimate.velocity
    lengths = length(estimate.joints[:, 1:] - estimate.joints[:, :-1])
    limbs = unit(moved[:, 1:] - moved[:, :-1])
    joints = np.empty_like(moved)
    joints[:, 0] = moved[:, 0]
    joints[:, 1] = joints[:, 0] + lengths[:, 0, None] * limbs[:, 0]
    joints[:, 2] = joints[:, 1] + lengths[:, 1, None] * limbs[:, 1]
    R = estimate.R_pelvis_wrist.copy()
    for column in range(3):
        R[:, :, column] = transport(R[:, :, column], estimate.limbs[:, 1], limbs[:, 1])
    return replace(estimate, joints=joints, limbs=limbs, R_pelvis_wrist=R)
