"""What is in front of a joint: its skin, its hand, another joint."""

import numpy as np
import pytest
from painted_person import INTRINSICS

from camera_client.calibration import TYPICAL
from camera_client.surface import SHOULDER_DROP, covered, hands_before, shoulder_shift


def arm(fore: tuple[float, float, float]) -> np.ndarray:
    """Two like arms with hanging upper arms, optical frame, shape (2, 3, 3) [m]."""
    shoulder, elbow = np.array([0.2, -0.3, 2.9]), np.array([0.2, 0.0, 2.9])
    return np.tile([shoulder, elbow, elbow + 0.25 * np.array(fore) / np.linalg.norm(fore)], (2, 1, 1))


def test_a_forearm_at_the_camera_shows_its_hand():
    towards = tuple(-arm((1.0, 0.0, 0.0))[0, 1])
    assert hands_before(arm(towards)).tolist() == pytest.approx([1.0, 1.0])
    for fore in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        assert (hands_before(arm(fore)) == 0.0).all()


def test_a_joint_behind_another_one_is_told_by_its_depth():
    arms = arm((0.0, 0.05, -1.0))
    depth = arms[..., 2].copy()
    assert not covered(arms, depth).any()
    # At the elbow's pixel is the depth of the hand.
    depth[0, 1] = arms[0, 2, 2]
    assert covered(arms, depth).tolist() == [[False, True, False], [False, False, False]]
    # The hand itself is in front, whatever is measured.
    depth[1, 2] = arms[1, 1, 2]
    assert not covered(arms, depth)[1].any()
    assert not covered(arms, np.full((2, 3), np.nan)).any()


def test_a_shoulder_is_below_its_landmark():
    shift = shoulder_shift(TYPICAL.up_camera, 2.5, INTRINSICS)
    assert shift.tolist() == pytest.approx([0.0, SHOULDER_DROP * INTRINSICS.fy / 2.5])
