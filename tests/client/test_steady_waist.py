"""What a low-pass of second order does, against its own closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ik_client.steady_waist import LONGEST_GAP, TIME_CONSTANT, SteadyWaist

TICK = 0.001
waists = arrays(float, 3, elements=st.floats(-1.0, 1.0))


def follow(path, seconds: float, tick: float = TICK) -> np.ndarray:
    """What becomes of a measurement that is a function of time, shape (ticks,)."""
    steady, times = SteadyWaist(), np.arange(0.0, seconds, tick)
    return np.array([taken(steady, np.array([path(t)]), t)[0] for t in times])


def taken(steady: SteadyWaist, waist: np.ndarray, now: float) -> np.ndarray:
    """What a measurement becomes."""
    given = steady.update(waist, now)
    assert given is not None
    return given


@given(waists)
def test_what_stands_still_is_given_back_as_it_is(waist):
    steady = SteadyWaist()
    for k in range(5):
        assert np.array_equal(taken(steady, waist, 0.02 * k), waist)


@pytest.mark.parametrize("tick", [0.001, 0.02])
def test_a_step_is_made_up_for_as_by_two_equal_stages(tick):
    """1 - (1 + t/T) exp(-t/T), at whatever rate it is measured; the first stage has a tick's lead."""
    got = follow(lambda t: float(t > 0.0), 2.0, tick)
    t = np.arange(0.0, 2.0, tick) / TIME_CONSTANT
    assert np.abs(got - (1.0 - (1.0 + t) * np.exp(-t))).max() < 2.0 * tick / TIME_CONSTANT
    assert got[round(1.0 / tick)] > 0.9


@pytest.mark.parametrize("frequency", [1.0, 3.0, 10.0])
def test_a_swing_is_let_through_as_by_two_equal_stages(frequency):
    omega = 2.0 * math.pi * frequency
    got = follow(lambda t: math.sin(omega * t), 8.0)[-round(1.0 / frequency / TICK) :]
    assert np.ptp(got) / 2.0 == pytest.approx(1.0 / (1.0 + (omega * TIME_CONSTANT) ** 2), rel=0.02)


def test_it_begins_anew_after_a_gap_without_a_measurement_and_with_another_waist():
    steady, far = SteadyWaist(), np.array([0.5, 0.0, 0.0])
    for lost, waist, now in (
        (False, far, 1.0 + 2.0 * LONGEST_GAP),
        (True, far, 1.02),
        (False, far[:2], 1.02),
        (False, far, -5.0),
    ):
        steady.update(np.zeros(3), 0.5)
        steady.update(np.zeros(3), 1.0)
        if lost:
            steady.update(None, 1.01)
        assert taken(steady, waist, now)[0] == 0.5


def test_what_is_no_measurement_is_given_back_and_forgotten():
    steady, bad = SteadyWaist(), np.array([np.nan, 0.0, 0.0])
    steady.update(np.zeros(3), 0.0)
    assert steady.update(None, 0.02) is None
    assert steady.update(bad, 0.04) is bad
    assert np.array_equal(taken(steady, np.ones(3), 0.06), np.ones(3))
