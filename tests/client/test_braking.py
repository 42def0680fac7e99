"""Where joints come to rest: against the planner's own braking, which we did not write."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ik_client.braking import stopping_points

ruckig = pytest.importorskip("ruckig")

A_MAX, J_MAX, V_MAX = 20.0, 1000.0, 3.0


def rest_of(q: float, velocity: float, acceleration: float) -> float:
    """Oracle: ruckig's time-optimal way to no velocity."""
    planner, plan, way = ruckig.Ruckig(1), ruckig.InputParameter(1), ruckig.Trajectory(1)
    plan.control_interface = ruckig.ControlInterface.Velocity
    plan.current_position, plan.current_velocity, plan.current_acceleration = [q], [velocity], [acceleration]
    plan.max_velocity, plan.max_acceleration, plan.max_jerk = [V_MAX], [A_MAX], [J_MAX]
    planner.calculate(plan, way)
    return way.at_time(way.duration)[0][0]


@given(st.floats(-2, 2), st.floats(-V_MAX, V_MAX), st.floats(-A_MAX, A_MAX))
def test_the_true_point_is_between_both(q, velocity, acceleration):
    # States a limiter can be in: those from which the velocity limit is kept.
    assume(abs(velocity + 0.5 * acceleration * abs(acceleration) / J_MAX) <= V_MAX)
    state = np.array([q]), np.array([velocity]), np.array([acceleration])
    low, high = stopping_points(*state, np.array([A_MAX]), np.array([J_MAX]))
    rest = rest_of(q, velocity, acceleration)
    assert low[0] - 1e-9 <= rest <= high[0] + 1e-9
    assert low[0] <= q <= high[0]


@given(st.floats(-2, 2), st.floats(0.0, V_MAX), st.floats(0.0, A_MAX))
def test_away_from_rest_it_is_exact(q, velocity, acceleration):
    assume(velocity + 0.5 * acceleration**2 / J_MAX <= V_MAX)
    state = np.array([q]), np.array([velocity]), np.array([acceleration])
    _, high = stopping_points(*state, np.array([A_MAX]), np.array([J_MAX]))
    assert high[0] == pytest.approx(rest_of(q, velocity, acceleration), abs=1e-9)
