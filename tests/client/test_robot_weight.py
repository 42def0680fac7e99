"""The weight's ramp."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_client.robot_end.weight import WeightRamp


@given(st.integers(1, 500), st.sampled_from([0.002, 0.005, 0.02]))
def test_up_and_down_take_the_same_number_of_ticks(ticks, dt):
    ramp = WeightRamp(ticks * dt)
    up = [ramp.step(1.0, dt) for _ in range(ticks)]
    down = [ramp.step(0.0, dt) for _ in range(ticks)]
    np.testing.assert_allclose(up, np.arange(1, ticks + 1) / ticks, atol=1e-9)
    np.testing.assert_allclose(down, 1.0 - np.arange(1, ticks + 1) / ticks, atol=1e-9)
    assert (up[-1], down[-1]) == (1.0, 0.0)


@given(st.lists(st.tuples(st.sampled_from([0.0, 1.0]), st.floats(0.0, 1.0)), max_size=60))
def test_it_never_leaves_its_range_nor_its_rate(steps):
    ramp, before = WeightRamp(2.0), 0.0
    for goal, dt in steps:
        value = ramp.step(goal, dt)
        assert 0.0 <= value <= 1.0
        assert abs(value - before) <= dt / 2.0 + 1e-9
        before = value


@pytest.mark.parametrize("duration", [0.0, -1.0, float("nan")])
def test_it_takes_a_positive_time(duration):
    with pytest.raises(ValueError, match="positive time"):
        WeightRamp(duration)
