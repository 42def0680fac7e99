"""From what a camera sees to where a joint is.

- The skin is in front of the bone, by an offset along the optical axis.
- A forearm that points at the camera shows its hand, which is before the wrist, and little of it.
- A joint behind another one of its arm is not what the camera sees there.
- What a pose model calls a shoulder is the top of it, above the joint.

The numbers are medians over the postures of a rendered person with known joints, with MediaPipe's landmarks.
"""

import numpy as np
from numpy.typing import NDArray

from camera_client.frame import Intrinsics
from camera_client.vectors import dot, unit
from ik_proto import Array

OFFSETS = np.array([0.058, 0.036, 0.030, 0.058, 0.036, 0.030, 0.108, 0.108])
"""How much deeper the centre of each tracked joint is than the surface before it, shape (8,) [m]."""
OFFSETS.flags.writeable = False
HAND = 0.115
"""How far a hand is before the surface of its wrist when it points at the camera [m]."""
HAND_SHARE = 0.25
"""The share of the wrist's surroundings that is this hand: behind it the forearm runs on to the elbow without a gap."""
SHOULDER_DROP = 0.025
"""How far the joint of a shoulder is below its landmark [m]."""
LEAN = 0.037
"""How far the middle between the shoulders is before the one between the hips, over the length of the trunk, of a
person who stands upright. People differ by some degrees, and it is not told from the camera's tilt."""

_POINTING = (0.85, 0.97)
"""Cosine between forearm and viewing ray from which on the hand begins to cover the wrist, and covers it."""
_BEFORE_SHOULDER = (0.70, 0.90)
"""Cosine between upper arm and viewing ray from which on the arm begins to cover its shoulder, and covers it."""
_COVERED = 0.06
"""Joints of an arm that are less than this apart across the viewing ray cover each other [m]."""
_OTHERS = np.array([[1, 2, 0], [2, 0, 1]])
"""The other two joints of the arm, below each joint."""


def shoulder_shift(up_camera: Array, depth: float, intrinsics: Intrinsics) -> Array:
    """From the landmark of a shoulder to its joint, shape (2,) [pixel].

    Args:
        up_camera: Up, optical frame, shape (3,).
        depth: Of the shoulders [m].
        intrinsics: Of the picture.
    """
    return -SHOULDER_DROP / depth * up_camera[:2] * (intrinsics.fx, intrinsics.fy)


def hands_before(arms: Array) -> Array:
    """How far forearms point at the camera and their hands are seen instead of their wrists, 0 to 1, shape (2,).

    Args:
        arms: Shoulder, elbow and wrist where the last frames expect them, optical frame, shape (2, 3, 3) [m].
    """
    fore = unit(arms[:, 2] - arms[:, 1])
    pointing = -dot(fore, unit(arms[:, 2]))
    return ((pointing - _POINTING[0]) / (_POINTING[1] - _POINTING[0])).clip(0.0, 1.0)


def shoulders_seen(arms: Array) -> Array:
    """How far shoulders are seen and not their own arm before them, 0 to 1, shape (2,); arms as in `hands_before`."""
    upper = unit(arms[:, 1] - arms[:, 0])
    pointing = -dot(upper, unit(arms[:, 0]))
    return ((_BEFORE_SHOULDER[1] - pointing) / (_BEFORE_SHOULDER[1] - _BEFORE_SHOULDER[0])).clip(0.0, 1.0)


def covered(arms: Array, depth: Array) -> NDArray[np.bool_]:
    """Which joints are behind another one of their arm, going by what is seen there.

    Args:
        arms: As in `hands_before`.
        depth: Depths of the joints as measured, shape (2, 3) [m]; NaN where not.

    Returns:
        Shape (2, 3): the joint is expected behind another one at about the same pixel, and the depth is rather the
        other's.
    """
    other = arms[:, _OTHERS]
    across = arms[:, None, :, :2] - other[..., :2]
    near = np.vecdot(across, across) < _COVERED**2
    behind = arms[:, None, :, 2] > other[..., 2]
    rather = np.abs(depth[:, None] - other[..., 2]) < np.abs(depth - arms[..., 2])[:, None]
    return np.asarray((near & behind & rather).any(axis=1))
