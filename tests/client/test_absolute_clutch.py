"""The clutch that takes a hand at its word: it begins where the wrist is and ends where the hand is."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ik_client import AbsoluteClutch
from ik_client.rotation import rotation_matrix, turn
from ik_proto import Array

VECTORS = hnp.arrays(np.float64, 3, elements=st.floats(-1.5, 1.5))
POSES = st.builds(lambda way, turned: pose(way, turned), VECTORS, VECTORS)


def pose(way, turned) -> Array:
    T = np.eye(4)
    T[:3, :3] = rotation_matrix(np.asarray(turned, dtype=float))
    T[:3, 3] = way
    return T


@given(POSES, POSES, st.floats(0.0, 0.99))
def test_it_begins_where_the_wrist_is_and_ends_where_the_hand_is(hand, wrist, authority):
    clutch = AbsoluteClutch()
    clutch.engage(hand, wrist)
    np.testing.assert_allclose(clutch.follow(hand, authority), wrist, atol=1e-9)
    np.testing.assert_allclose(clutch.follow(hand, 1.0), hand, atol=1e-9)


@given(POSES, POSES, POSES)
def test_while_the_offset_melts_the_wrist_moves_with_the_hand(hand, wrist, moved):
    """At a given authority, hand and wrist make the same motion: nothing is stretched."""
    clutch = AbsoluteClutch()
    clutch.engage(hand, wrist)
    clutch.follow(hand, 0.0)
    here, there = clutch.follow(hand, 0.3), clutch.follow(moved, 0.3)
    np.testing.assert_allclose(there[:3, 3] - here[:3, 3], moved[:3, 3] - hand[:3, 3], atol=1e-9)
    assert turn(here[:3, :3], there[:3, :3]) == pytest.approx(turn(hand[:3, :3], moved[:3, :3]), abs=1e-6)


def test_the_offset_melts_evenly_by_the_shortest_turn():
    clutch = AbsoluteClutch()
    hand, wrist = pose([0.0, 0.0, 0.0], [0.0, 0.0, 3.0]), pose([0.2, 0.0, 0.0], [0.0, 0.0, -3.0])
    clutch.engage(hand, wrist)
    targets = [clutch.follow(hand, authority) for authority in np.linspace(0.0, 1.0, 11)]
    np.testing.assert_allclose(np.diff([T[0, 3] for T in targets]), -0.02, atol=1e-12)
    turns = [turn(a[:3, :3], b[:3, :3]) for a, b in pairwise(targets)]
    np.testing.assert_allclose(turns, (2 * np.pi - 6.0) / 10.0, atol=1e-9)


def test_the_hand_is_not_written_to():
    clutch = AbsoluteClutch()
    hand = np.eye(4)
    clutch.engage(hand, pose([0.1, 0.2, 0.3], [0.1, 0.0, 0.0]))
    clutch.follow(hand, 0.0)
    np.testing.assert_array_equal(hand, np.eye(4))


def test_what_makes_no_sense_is_refused():
    clutch = AbsoluteClutch()
    with pytest.raises(ValueError, match="not engaged"):
        clutch.follow(np.eye(4))
    with pytest.raises(ValueError, match="is not a pose"):
        clutch.engage(np.full((4, 4), np.nan), np.eye(4))
    assert not clutch.engaged
    clutch.engage(np.eye(4), np.eye(4))
    assert clutch.engaged
    with pytest.raises(ValueError, match="authority"):
        clutch.follow(np.eye(4), 1.5)
    clutch.release()
    assert not clutch.engaged
