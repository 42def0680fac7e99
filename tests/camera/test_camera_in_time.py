"""The follower that knows all beforehand: it does what can be done in time, and no more than its limits allow."""

import numpy as np
import pytest
from in_time import best_angles

PERIOD, VELOCITY, ACCELERATION = 0.02, 3.0, 20.0
WITHIN = np.radians(12.0)
BOUNDS = np.array([-3.0, -1.5]), np.array([3.0, 1.5])


def direction(angles):
    """An arm that hangs: the first joint swings it forward, the second to its side."""
    a, b = angles.T
    return np.stack([np.sin(a) * np.cos(b), np.sin(b), -np.cos(a) * np.cos(b)], axis=1)


def follow(wanted, needed=None, begin=None, velocity=VELOCITY, within=WITHIN):
    """Angles of the best follower of joints that are wanted, shape (n, 2) [rad]."""
    return best_angles(
        direction,
        direction(wanted),
        np.ones(len(wanted), dtype=bool) if needed is None else needed,
        wanted if begin is None else begin,
        bounds=BOUNDS,
        most=(velocity, ACCELERATION),
        period=PERIOD,
        within=within,
    )


def swing(speed, ticks=100):
    """The arm is swung forward at a speed after half a second."""
    t = PERIOD * np.arange(ticks)
    return np.stack([speed * np.maximum(t - 0.5, 0.0), np.zeros(ticks)], axis=1)


def test_a_motion_within_the_limits_is_followed_throughout():
    t = PERIOD * np.arange(150)
    wanted = np.stack([0.8 * np.sin(2.0 * t), 0.5 - 0.5 * np.cos(1.5 * t)], axis=1)
    assert follow(wanted).max() <= WITHIN


def leaps(ticks=140, at=70, angle=np.pi / 2.0):
    wanted = np.zeros((ticks, 2))
    wanted[at:, 0] = angle
    return wanted


def test_a_leap_is_missed_for_as_long_as_the_way_takes():
    """From the edge of one circle to that of the other, at full speed there and on: both know what comes."""
    missed = int((follow(leaps()) > WITHIN).sum())
    least = (np.pi / 2.0 - 2.0 * WITHIN) / VELOCITY / PERIOD
    assert least - 1.0 <= missed <= least + 4.0
    # Twice as fast, half as long; a circle twice as large is a shorter way.
    assert (follow(leaps(), velocity=2.0 * VELOCITY) > WITHIN).sum() < 0.75 * missed
    assert (follow(leaps(), within=2.0 * WITHIN) > 2.0 * WITHIN).sum() < missed


def test_what_is_not_needed_costs_nothing():
    needed = np.ones(140, dtype=bool)
    needed[50:90] = False
    assert (follow(leaps(), needed)[needed] <= WITHIN).all()
    # Nor does it need to be told where to be there.
    begin = leaps()
    begin[~needed] = np.nan
    assert (follow(leaps(), needed, begin)[needed] <= WITHIN).all()


def test_it_begins_at_rest_at_zero():
    wanted = np.full((60, 2), [1.0, 0.0])
    missed = follow(wanted) > WITHIN
    # Accelerating for 0.15 s, then at full speed.
    assert missed.sum() * PERIOD == pytest.approx((1.0 - WITHIN) / VELOCITY + 0.5 * VELOCITY / ACCELERATION, abs=0.05)
    assert not missed[missed.sum() :].any()


@pytest.mark.parametrize(("speed", "followed"), [(2.0, True), (6.0, False)])
def test_a_person_who_is_faster_than_the_robot_is_lost(speed, followed):
    wanted = swing(speed, 75)
    assert bool((follow(wanted) <= WITHIN).all()) is followed


def test_joints_beyond_their_limits_are_missed():
    wanted = np.full((120, 2), [0.0, 1.5 + 2.0 * WITHIN])
    assert (follow(wanted) > WITHIN).all()


def test_where_nothing_is_possible_nothing_is_found():
    assert np.isinf(follow(leaps(), np.zeros(140, dtype=bool))).all()
