"""The clutch: relative to its snapshot, exact, never faster than the hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_client.clutch import Clutch
from ik_client.rotation import rotation_matrix, turn

VECTOR = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)
SCALE = st.floats(0.1, 3.0)


def make(position, vector):
    T = np.eye(4)
    T[:3, :3] = rotation_matrix(np.asarray(vector, dtype=float))
    T[:3, 3] = position
    return T


POSES = st.builds(make, VECTOR, VECTOR)


@given(POSES, POSES, SCALE, st.floats(0.0, 1.0))
def test_engaging_asks_for_where_the_wrist_is(hand, wrist, scale, authority):
    """Hazard row "first frame / re-clutch": wherever hand and wrist are, the first target is the wrist itself."""
    clutch = Clutch(scale)
    clutch.engage(hand, wrist)
    np.testing.assert_allclose(clutch.follow(hand, authority), wrist, rtol=0, atol=1e-14)


@given(POSES, POSES, VECTOR, VECTOR, SCALE)
def test_the_wrist_moves_as_the_hand_does(hand, wrist, way, rotation, scale):
    """In the axes of the frame, not in the hand's own: the oracle moves hand and wrist by the same motion."""
    clutch = Clutch(scale)
    clutch.engage(hand, wrist)
    R = rotation_matrix(rotation)
    moved, expected = hand.copy(), wrist.copy()
    moved[:3, 3] += way
    moved[:3, :3] = R @ hand[:3, :3]
    expected[:3, 3] += scale * way
    expected[:3, :3] = R @ wrist[:3, :3]
    np.testing.assert_allclose(clutch.follow(moved), expected, rtol=0, atol=1e-13)


@given(POSES, POSES, st.lists(POSES, max_size=10))
def test_with_full_authority_a_hand_that_returns_brings_the_wrist_back(hand, wrist, way):
    clutch = Clutch()
    clutch.engage(hand, wrist)
    for pose in way:
        clutch.follow(pose)
    np.testing.assert_allclose(clutch.follow(hand), wrist, rtol=0, atol=1e-13)


@given(POSES, POSES, st.lists(st.tuples(POSES, st.floats(0.0, 1.0)), min_size=1, max_size=10), SCALE)
def test_under_any_authority_the_wrist_is_never_faster_than_the_hand(hand, wrist, ticks, scale):
    clutch = Clutch(scale)
    clutch.engage(hand, wrist)
    full = False
    for pose, authority in ticks:
        authority = 1.0 if full else authority
        full = authority == 1.0
        target = clutch.follow(pose, authority)
        way = np.linalg.norm(target[:3, 3] - wrist[:3, 3])
        assert way <= scale * np.linalg.norm(pose[:3, 3] - hand[:3, 3]) + 1e-12
        assert turn(wrist[:3, :3], target[:3, :3]) <= turn(hand[:3, :3], pose[:3, :3]) + 1e-7
        hand, wrist = pose, target


def test_half_authority_goes_half_the_way_and_catches_nothing_up():
    clutch = Clutch()
    clutch.engage(np.eye(4), np.eye(4))
    target = clutch.follow(make([0.2, 0.0, 0.0], [0.0, 0.0, 0.4]), 0.5)
    np.testing.assert_allclose(target, make([0.1, 0.0, 0.0], [0.0, 0.0, 0.2]), rtol=0, atol=1e-15)
    again = clutch.follow(make([0.2, 0.0, 0.0], [0.0, 0.0, 0.4]), 1.0)
    np.testing.assert_allclose(again, target, rtol=0, atol=1e-15)


def test_ratcheting_moves_the_wrist_out_while_the_hand_returns():
    clutch, wrist = Clutch(), np.eye(4)
    for _ in range(3):
        clutch.engage(np.eye(4), wrist)
        wrist = clutch.follow(make([0.1, 0.0, 0.0], [0.0, 0.0, 0.0]))
        clutch.release()
    np.testing.assert_allclose(wrist[:3, 3], [0.3, 0.0, 0.0], rtol=0, atol=1e-15)


def test_an_open_clutch_follows_nothing():
    clutch = Clutch()
    with pytest.raises(ValueError, match="not engaged"):
        clutch.follow(np.eye(4))
    clutch.engage(np.eye(4), np.eye(4))
    assert clutch.engaged
    clutch.release()
    assert not clutch.engaged
    with pytest.raises(ValueError, match="not engaged"):
        clutch.follow(np.eye(4))


def test_a_snapshot_of_no_pose_is_refused_and_the_old_one_stays():
    clutch = Clutch()
    clutch.engage(np.eye(4), np.eye(4))
    with pytest.raises(ValueError, match="not within"):
        clutch.engage(np.eye(4), make([np.nan, 0.0, 0.0], [0.0, 0.0, 0.0]))
    np.testing.assert_array_equal(clutch.follow(np.eye(4)), np.eye(4))


def test_a_snapshot_is_a_copy():
    hand, wrist = np.eye(4), np.eye(4)
    clutch = Clutch()
    clutch.engage(hand, wrist)
    hand[0, 3] = wrist[0, 3] = 9.0
    np.testing.assert_array_equal(clutch.follow(np.eye(4)), np.eye(4))


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf")])
def test_the_scale_is_a_positive_number(scale):
    with pytest.raises(ValueError, match="scale must be a positive number"):
        Clutch(scale)


@pytest.mark.parametrize("authority", [-0.1, 1.1, float("nan")])
def test_authority_is_a_fraction(authority):
    clutch = Clutch()
    clutch.engage(np.eye(4), np.eye(4))
    with pytest.raises(ValueError, match="authority must be within"):
        clutch.follow(np.eye(4), authority)
