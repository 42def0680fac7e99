"""The lock: the operator may walk, a passer-by may not take over."""

import numpy as np

from camera_client.operator_lock import FARTHEST, OperatorLock

HERE = np.array([0.0, -0.3, 2.9])


def test_the_first_body_is_the_operator():
    lock = OperatorLock()
    assert not lock.locked
    assert lock.admit(HERE, 0.0)
    assert lock.locked


def test_an_operator_may_walk():
    lock, place = OperatorLock(), HERE.copy()
    for k in range(90):
        place = place + np.array([1.4 / 30.0, 0.0, 0.0])
        assert lock.admit(place, k / 30.0)


def test_a_passer_by_is_refused_until_the_operator_is_back():
    lock = OperatorLock()
    lock.admit(HERE, 0.0)
    for k in range(1, 300):
        assert not lock.admit(HERE + np.array([1.0, 0.0, -0.8]), k / 30.0)
    assert lock.refused == 299
    assert lock.admit(HERE + np.array([0.0, 0.0, 0.1]), 10.0)


def test_nobody_comes_back_too_far_away():
    lock = OperatorLock()
    lock.admit(HERE, 0.0)
    assert not lock.admit(HERE + np.array([FARTHEST + 0.01, 0.0, 0.0]), 3600.0)
    assert lock.admit(HERE + np.array([FARTHEST - 0.01, 0.0, 0.0]), 3600.0)


def test_a_release_takes_whoever_comes():
    lock = OperatorLock()
    lock.admit(HERE, 0.0)
    lock.release()
    assert lock.admit(HERE + np.array([3.0, 0.0, 0.0]), 0.1)
