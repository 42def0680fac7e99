"""The step limiter's bound, for all inputs and to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ik_client import StepLimiter

JOINT = st.floats(-1e6, 1e6)
ANYTHING = st.floats(allow_nan=True, allow_infinity=True)
STEP = st.floats(1e-9, 10.0)


def vectors(elements, n=14):
    return hnp.arrays(np.float64, n, elements=elements)


@given(vectors(JOINT), vectors(ANYTHING | JOINT), STEP)
def test_no_joint_moves_further_than_the_step(q_last, q_wanted, max_step):
    q_next = StepLimiter(max_step).limit(q_last, q_wanted)
    assert np.isfinite(q_next).all()
    assert (np.abs(q_next - q_last) <= max_step).all()


@given(vectors(JOINT), vectors(st.floats(-0.99, 0.99)), STEP)
def test_what_is_within_the_step_passes_unchanged(q_last, fraction, max_step):
    q_wanted = q_last + fraction * max_step
    q_wanted = np.where(np.abs(q_wanted - q_last) <= 0.999 * max_step, q_wanted, q_last)
    np.testing.assert_array_equal(StepLimiter(max_step).limit(q_last, q_wanted), q_wanted)


@given(vectors(st.floats(-3, 3)), vectors(st.floats(-3, 3)))
def test_it_arrives_and_stays_between_where_it_was_and_where_it_goes(q_last, q_wanted):
    limiter, q = StepLimiter(0.1), q_last
    for _ in range(61):
        q = limiter.limit(q, q_wanted)
        assert (np.minimum(q_last, q_wanted) <= q).all()
        assert (q <= np.maximum(q_last, q_wanted)).all()
    np.testing.assert_array_equal(q, q_wanted)


def test_a_joint_without_a_finite_goal_stays():
    q_last = np.array([0.1, 0.2, 0.3, 0.4])
    q_next = StepLimiter(0.01).limit(q_last, np.array([np.nan, np.inf, -np.inf, 1.0]))
    np.testing.assert_array_equal(q_next[:3], q_last[:3])
    assert q_next[3] > q_last[3]


def test_the_result_is_a_new_array():
    q = np.zeros(3)
    assert StepLimiter(0.1).limit(q, q) is not q


def test_a_plain_clip_would_break_the_bound():
    """The negative control of the last-bit rule: without the step back, some sums round beyond the bound."""
    rng = np.random.default_rng(1)
    q_last, max_step = rng.uniform(-3, 3, 100_000), 0.01
    plain = np.clip(q_last + 1.0, q_last - max_step, q_last + max_step)
    assert (np.abs(plain - q_last) > max_step).any()
    limited = StepLimiter(max_step).limit(q_last, q_last + 1.0)
    assert (np.abs(limited - q_last) <= max_step).all()


@pytest.mark.parametrize("max_step", [0.0, -0.01, float("nan"), float("inf")])
def test_the_bound_is_a_positive_number(max_step):
    with pytest.raises(ValueError, match="max_step must be a positive number"):
        StepLimiter(max_step)
