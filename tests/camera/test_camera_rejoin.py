"""Rejoining: no jump when an arm comes back, a bounded speed, and an end of it."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from camera_client.rejoin import SHIFT_RATE, TURN_RATE, Rejoin
from camera_client.vectors import unit

DT = 1.0 / 30.0


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_an_arm_comes_back_without_a_jump_and_arrives(seed):
    rng = np.random.default_rng(seed)
    shown, found = unit(rng.standard_normal((2, 2, 2, 3)))
    shoulders = rng.uniform(-0.1, 0.1, (2, 2, 3))
    rejoin = Rejoin()
    rejoin.begin(np.array([True, True]), (shoulders[0], shoulders[1]), (shown, found))
    last_shoulders, last = shoulders[0], shown
    for _ in range(90):
        now_shoulders, now = rejoin.apply(shoulders[1], found, DT)
        assert (np.arccos(np.clip((now * last).sum(axis=-1), -1.0, 1.0)) <= TURN_RATE * DT + 2e-3).all()
        assert (np.linalg.norm(now_shoulders - last_shoulders, axis=-1) <= SHIFT_RATE * DT + 2e-3).all()
        assert np.allclose(np.linalg.norm(now, axis=-1), 1.0)
        last_shoulders, last = now_shoulders, now
    assert np.allclose(last, found)
    assert np.allclose(last_shoulders, shoulders[1])


def test_an_arm_that_did_not_jump_is_left_alone():
    shown, found = unit(np.random.default_rng(0).standard_normal((2, 2, 2, 3)))
    rejoin = Rejoin()
    rejoin.begin(np.array([True, False]), (np.zeros((2, 3)), np.zeros((2, 3))), (shown, found))
    _, now = rejoin.apply(np.zeros((2, 3)), found, DT)
    assert (now[1] == found[1]).all()
    assert not np.allclose(now[0], found[0])
