"""The seeds' filter, quirks included."""

import numpy as np
import pytest

from ik_proto.smoothing import WeightedMovingFilter


def test_three_samples_pass_then_the_newest_weighs_most() -> None:
    smooth = WeightedMovingFilter()
    samples = [np.array([k, -k], dtype=float) for k in (1, 2, 4, 8)]
    assert [smooth(q).tolist() for q in samples[:3]] == [[1, -1], [2, -2], [4, -4]]
    expected = 0.4 * 8 + 0.3 * 4 + 0.2 * 2 + 0.1 * 1
    assert smooth(samples[3]) == pytest.approx([expected, -expected])


def test_it_agrees_with_convolution() -> None:
    x = np.random.default_rng(3).normal(size=50)
    smooth = WeightedMovingFilter()
    got = [smooth(np.array([v]))[0] for v in x]
    assert got[3:] == pytest.approx(np.convolve(x, [0.4, 0.3, 0.2, 0.1], "valid"))


def test_a_repeated_sample_is_not_counted_again() -> None:
    smooth = WeightedMovingFilter()
    for value in (0.0, 1.0, 2.0, 3.0):
        last = smooth(np.array([value]))
    assert np.array_equal(smooth(np.array([3.0])), last)


def test_reset_forgets() -> None:
    smooth = WeightedMovingFilter()
    for value in range(9):
        smooth(np.array([float(value)]))
    smooth.reset()
    assert smooth(np.array([5.0])).tolist() == [5.0]


def test_weights_must_add_up() -> None:
    with pytest.raises(ValueError, match=r"add up to 0\.9"):
        WeightedMovingFilter((0.5, 0.4))
