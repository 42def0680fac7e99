"""A stick's response: properties of the dead zone and the curve."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamepad_client.shaping import Shaping

AXIS = st.floats(-1.0, 1.0)
SHAPINGS = st.builds(Shaping, st.floats(0.0, 0.9), st.floats(0.2, 5.0))


@given(shaping=SHAPINGS, x=AXIS, y=AXIS)
def test_direction_is_kept_and_length_is_within_the_circle(shaping, x, y):
    a, b = shaping.stick(x, y)
    assert math.hypot(a, b) <= 1.0 + 1e-12
    assert a * y - b * x == pytest.approx(0.0, abs=1e-12)  # parallel
    assert a * x + b * y >= 0.0  # and not the other way
    assert (a, b) == (0.0, 0.0) or math.hypot(x, y) > shaping.dead_zone


@given(shaping=SHAPINGS, direction=st.floats(0.0, 2.0 * math.pi), way=st.floats(0.0, 1.0), more=st.floats(0.0, 1.0))
def test_further_is_never_less(shaping, direction, way, more):
    def length(r):
        return math.hypot(*shaping.stick(r * math.cos(direction), r * math.sin(direction)))

    assert length(max(way, more)) >= length(min(way, more)) - 1e-12


@given(shaping=SHAPINGS)
def test_it_begins_at_nothing_and_ends_at_all(shaping):
    assert shaping.stick(shaping.dead_zone, 0.0) == (0.0, 0.0)
    assert shaping.stick(min(1.0, shaping.dead_zone + 1e-12), 0.0)[0] < 0.02
    assert shaping.stick(0.0, -1.0) == pytest.approx((0.0, -1.0))
    assert shaping.stick(1.0, 1.0) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))


def test_a_stick_that_is_pushed_straight_is_not_drawn_to_an_axis():
    """An axial dead zone would take the small share of the other axis away."""
    a, b = Shaping(0.2, 1.0).stick(1.0, 0.1)
    assert b / a == pytest.approx(0.1)


def test_a_curve_is_finer_about_the_middle():
    assert Shaping(0.1, 2.0).pull(0.4) < Shaping(0.1, 1.0).pull(0.4)


def test_nan_is_rest():
    assert Shaping().stick(math.nan, 0.5) == (0.0, 0.0)
