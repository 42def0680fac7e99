"""The check behind the limiter, with bodies simple enough to be certain: walls across joint space.

Hazard: self-collision. Every test here is about what a robot is commanded, not about what a solver answered.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_client.clear_way import KEPT, ClearWay
from ik_client.joint_limiter import JointLimiter, MotionLimits

pytest.importorskip("ruckig")

N = 2
TICK = 0.02
LIMITS = MotionLimits()
WALL = 0.5


def wall(q, waist):
    """Distance of the first joint from a wall, as if a radian were a metre."""
    return WALL - q[:, 0]


def far_away(q, waist):
    return np.full(len(q), 1.0)


def drive(way, goals, start=None):
    q = np.zeros(N) if start is None else np.array(start)
    commands = [q]
    for goal in goals:
        q = way.step(q, np.asarray(goal, dtype=float), TICK, None)
        commands.append(q)
    return np.array(commands)


def assert_bounded(q):
    q = np.vstack([q[:1], q[:1], q])
    assert np.abs(np.diff(q, axis=0)).max() <= LIMITS.velocity * TICK * (1 + 1e-6)
    assert np.abs(np.diff(q, 2, axis=0)).max() <= LIMITS.acceleration * TICK**2 * (1 + 1e-6)
    assert np.abs(np.diff(q, 3, axis=0)).max() <= LIMITS.jerk * TICK**3 * (1 + 1e-6)


def run_into_the_wall(seconds=2.0, speed=2.0):
    """Goals that come at a speed and stop at the wall, as a solver's answers do."""
    count = round(seconds / TICK)
    return [np.array([min(speed * TICK * k, WALL - 0.01), 0.1]) for k in range(count)]


def test_far_from_everything_it_is_the_limiter():
    goals = [np.array([np.sin(0.1 * k), np.cos(0.07 * k)]) for k in range(100)]
    alone, limiter = [np.zeros(N)], JointLimiter(N, TICK)
    for goal in goals:
        alone.append(limiter.limit(alone[-1], goal, TICK))
    np.testing.assert_array_equal(drive(ClearWay(JointLimiter(N, TICK), far_away), goals), alone)


def test_momentum_is_stopped_before_the_wall():
    commands = drive(ClearWay(JointLimiter(N, TICK), wall), run_into_the_wall())
    assert (WALL - commands[:, 0]).min() >= KEPT - 1e-9
    assert commands[-1, 0] == pytest.approx(WALL - 0.01, abs=1e-6)  # and the answer is reached all the same
    assert_bounded(commands)


def test_the_limiter_alone_would_hit_it():
    """The negative control: clear answers are not enough, for an arm that comes with speed."""
    limiter, q, nearest = JointLimiter(N, TICK), np.zeros(N), np.inf
    for goal in run_into_the_wall():
        q = limiter.limit(q, goal, TICK)
        nearest = min(nearest, WALL - q[0])
    assert nearest < 0.0


def test_too_near_already_it_may_leave_and_come_no_nearer():
    start = [WALL - 0.002, 0.0]
    away = drive(ClearWay(JointLimiter(N, TICK), wall), [[0.0, 0.0]] * 60, start)
    assert away[-1, 0] == pytest.approx(0.0, abs=1e-6)
    assert (np.diff(away[:, 0]) <= 1e-9).all()
    nearer = drive(ClearWay(JointLimiter(N, TICK), wall), [[WALL + 0.2, 0.3]] * 60, start)
    assert nearer[:, 0].max() <= start[0] + 1e-4


def test_in_penetration_it_only_opens():
    commands = drive(ClearWay(JointLimiter(N, TICK), wall), [[WALL - 0.02, 0.0]] * 60, [WALL + 0.05, 0.0])
    assert (np.diff(commands[:, 0]) <= 1e-9).all()
    assert commands[-1, 0] == pytest.approx(WALL - 0.02, abs=1e-6)


def test_beside_an_obstacle_the_straight_way_is_taken():
    """Each joint in its own time would cut the corner; slower and together they pass."""

    def corner(q, waist):
        # What may be is near the diagonal: the joints have to go together.
        return 0.02 - np.abs(q[:, 0] - 0.25 * q[:, 1])

    goal = np.array([0.25, 1.0])
    commands = drive(ClearWay(JointLimiter(N, TICK), corner), [goal] * 400)
    assert corner(commands, None).min() >= KEPT - 1e-9
    np.testing.assert_allclose(commands[-1], goal, atol=1e-6)
    assert_bounded(commands)


def test_where_the_clearance_cannot_be_told_nothing_has_happened():
    limiter = JointLimiter(N, TICK)
    told = True

    def measure(q, waist):
        if not told:
            raise TimeoutError("no answer")
        return np.full(len(q), 1.0)

    way = ClearWay(limiter, measure)
    q = drive(way, [[1.0, 1.0]] * 5)[-1]
    velocity = limiter.velocity
    told = False
    with pytest.raises(TimeoutError):
        way.step(q, np.ones(N), TICK, None)
    np.testing.assert_array_equal(limiter.velocity, velocity)
    stopped = limiter.limit(q, np.full(N, np.nan), TICK)
    assert (stopped > q).all()  # it brakes from the speed it had, rather than from rest


def test_the_measured_waist_is_handed_on():
    seen = []

    def measure(q, waist):
        seen.append(waist)
        return np.full(len(q), 1.0)

    waist = np.array([0.1, 0.2, 0.3])
    ClearWay(JointLimiter(N, TICK), measure).step(np.zeros(N), np.ones(N), TICK, waist)
    assert all(each is waist for each in seen)
    assert seen


POINTS = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


@given(
    st.lists(st.tuples(POINTS, st.integers(1, 15)), min_size=1, max_size=8),
    POINTS,
    st.floats(0.05, 0.4),
)
def test_whatever_is_wanted_no_command_comes_nearer_than_is_kept(wishes, centre, radius):
    """A ball in the way: outside of it everything is allowed, inside nothing."""

    def ball(q, waist):
        return np.linalg.norm(q - np.array(centre), axis=1) - radius

    start = np.zeros(N)
    if ball(start[None], None)[0] < KEPT:
        start = np.array(centre) + np.array([radius + 0.05, 0.0])
    goals = [np.array(goal) for goal, ticks in wishes for _ in range(ticks)]
    commands = drive(ClearWay(JointLimiter(N, TICK), ball), goals, start)
    assert ball(commands, None).min() >= KEPT - 1e-5
    assert_bounded(commands)
