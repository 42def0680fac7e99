"""The joint limiter's bounds, by differences of the commands it gives: what a robot sees."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ik_client import StepLimiter
from ik_client.joint_limiter import JointLimiter, MotionLimits

ruckig = pytest.importorskip("ruckig")

N = 3
PERIOD = 0.02
LIMITS = MotionLimits()


def assert_within(commands, intervals, limits=LIMITS):
    """Every difference quotient is within its bound, to the rounding of the commands themselves.

    A mean value over an interval cannot exceed the bound of what it is a mean of, so this is exact, not approximate.
    """
    q, dt = np.asarray(commands), np.asarray(intervals, dtype=float)[1:, None]
    rounding = 4.0 * np.spacing(np.abs(q).max())
    v = np.diff(q, axis=0) / dt
    a = np.diff(v, axis=0) / (0.5 * (dt[1:] + dt[:-1]))
    assert np.abs(v).max(initial=0.0) <= limits.velocity * (1 + 1e-9) + rounding / dt.min()
    assert np.abs(a).max(initial=0.0) <= limits.acceleration * (1 + 1e-9) + 4 * rounding / dt.min() ** 2
    if np.ptp(dt) == 0.0:
        j = np.diff(a, axis=0) / dt[2:]
        assert np.abs(j).max(initial=0.0) <= limits.jerk * (1 + 1e-6) + 8 * rounding / dt.min() ** 3


def run(limiter, start, goals, intervals=None):
    q = np.array(start, dtype=float)
    commands = [q]
    for k, goal in enumerate(goals):
        q = limiter.limit(q, np.asarray(goal, dtype=float), *([] if intervals is None else [intervals[k]]))
        assert np.isfinite(q).all()
        commands.append(q)
    return np.array(commands)


GOAL = st.floats(-3.0, 3.0) | st.floats() | st.sampled_from([np.nan, np.inf, -np.inf, 1e308, 0.0, 5e-324])
GOALS = st.lists(st.tuples(st.tuples(*[GOAL] * N), st.integers(1, 12)), min_size=1, max_size=12).map(
    lambda parts: [goal for goal, ticks in parts for _ in range(ticks)]
)
STARTS = st.tuples(*[st.floats(-3.0, 3.0)] * N)


@given(STARTS, GOALS)
def test_velocity_acceleration_and_jerk_are_bounded_for_all_inputs(start, goals):
    """Hazard row "velocity / acceleration / jerk"; the first step from any start is among them ("first frame")."""
    commands = run(JointLimiter(N, PERIOD), start, goals)
    assert_within([commands[0], commands[0], commands[0], *commands], [PERIOD] * (len(commands) + 3))


@given(
    STARTS,
    GOALS,
    st.floats(0.05, 40.0),
    st.floats(0.5, 500.0),
    st.floats(5.0, 50_000.0),
    st.sampled_from([0.002, 0.005, 0.02, 0.05]),
)
def test_any_bounds_are_kept(start, goals, velocity, acceleration, jerk, period):
    limits = MotionLimits(velocity, acceleration, jerk)
    commands = run(JointLimiter(N, period, limits), start, goals)
    assert_within([*[commands[0]] * 3, *commands], [period] * (len(commands) + 3), limits)


@given(STARTS, GOALS, st.data())
def test_the_bounds_hold_at_uneven_ticks(start, goals, data):
    """Hazard row "loop overrun": the interval is taken as within half a period and two, whatever the clock says."""
    n = len(goals)
    anything = st.floats(0.0, 3.0 * PERIOD) | st.sampled_from([0.0, -1.0, np.nan, np.inf, 1e9])
    given_dt = data.draw(st.lists(anything, min_size=n, max_size=n))
    taken = [0.5 * PERIOD if not dt > 0.5 * PERIOD else min(dt, 2.0 * PERIOD) for dt in given_dt]
    commands = run(JointLimiter(N, PERIOD), start, goals, given_dt)
    assert_within([*[commands[0]] * 3, *commands], [PERIOD, PERIOD, PERIOD, PERIOD, *taken])


@given(STARTS, st.tuples(*[st.floats(-3.0, 3.0)] * N))
def test_it_arrives_and_stays(start, goal):
    commands = run(JointLimiter(N, PERIOD), start, [goal] * 150)
    np.testing.assert_allclose(commands[-1], goal, rtol=0, atol=1e-9)
    np.testing.assert_allclose(commands[-2], goal, rtol=0, atol=1e-9)
    lower, upper = np.minimum(start, goal), np.maximum(start, goal)
    assert (commands >= lower - 1e-9).all()
    assert (commands <= upper + 1e-9).all()


@given(STARTS, GOALS)
def test_no_goal_brakes_to_the_resting_point_and_holds(start, goals):
    """Hazard rows "deadman release" and "stale target": at rest within v / a + a / j, where it said it would be."""
    limiter = JointLimiter(N, PERIOD)
    commands = run(limiter, start, goals)
    hold = np.full(N, np.nan)
    first = limiter.limit(commands[-1], hold)
    resting_point = limiter.resting_point
    stop = int((LIMITS.velocity / LIMITS.acceleration + 2 * LIMITS.acceleration / LIMITS.jerk) / PERIOD) + 2
    braking = run(limiter, first, [hold] * (stop + 20))
    np.testing.assert_allclose(braking[stop:], np.broadcast_to(resting_point, (21, N)), rtol=0, atol=1e-9)
    assert np.ptp(braking[stop:], axis=0).max() <= 1e-12
    assert np.abs(limiter.velocity).max() <= 1e-9
    assert_within([*commands, *braking], [PERIOD] * (len(commands) + len(braking)))


@given(STARTS, st.tuples(*[st.floats(-3.0, 3.0)] * N), st.integers(0, N - 1))
def test_a_joint_without_a_goal_holds_while_the_others_go(start, goal, held):
    """Per arm: one holds, the other follows."""
    wanted = np.array(goal)
    wanted[held] = np.nan
    commands = run(JointLimiter(N, PERIOD), start, [wanted] * 150)
    assert (commands[:, held] == start[held]).all()
    others = [k for k in range(N) if k != held]
    np.testing.assert_allclose(commands[-1][others], np.array(goal)[others], rtol=0, atol=1e-9)


LOWER, UPPER, INSET = np.full(N, -1.0), np.full(N, 1.5), 0.05


@given(st.tuples(*[st.floats(-0.95, 1.45)] * N), GOALS)
def test_within_its_range_a_joint_stays_there(start, goals):
    """Hazard row "joint limits": no goal, and no braking, leads out of the range less its inset."""
    limiter = JointLimiter(N, PERIOD, lower=LOWER, upper=UPPER, inset=INSET)
    commands = run(limiter, start, [*goals, *[np.full(N, np.nan)] * 20])
    assert (commands >= LOWER + INSET - 1e-7).all()
    assert (commands <= UPPER - INSET + 1e-7).all()


@given(st.tuples(*[st.floats(-3.0, 3.0)] * N), GOALS)
def test_from_outside_its_range_a_joint_moves_inward_only(start, goals):
    """Hazard row "joint limits": recoverable from outside."""
    limiter = JointLimiter(N, PERIOD, lower=LOWER, upper=UPPER, inset=INSET)
    commands = run(limiter, start, goals)
    outside = np.maximum(np.maximum(LOWER + INSET - commands, commands - UPPER + INSET), 0.0)
    assert (np.diff(outside, axis=0) <= 1e-7).all()
    assert_within([*[commands[0]] * 3, *commands], [PERIOD] * (len(commands) + 3))


def test_a_step_limiter_would_break_the_acceleration():
    """The negative control: a clip of the same velocity breaks the acceleration, and the check says so."""
    limiter, q = StepLimiter(3.0 * PERIOD), np.zeros(N)
    assert LIMITS.velocity == 3.0
    commands = [q, q, q]
    for _ in range(10):
        commands.append(limiter.limit(commands[-1], np.ones(N)))
    with pytest.raises(AssertionError):
        assert_within(commands, [PERIOD] * len(commands))


def test_a_command_that_is_not_its_own_is_a_new_start_at_rest():
    limiter = JointLimiter(N, PERIOD)
    run(limiter, np.zeros(N), [np.ones(N)] * 5)
    assert np.abs(limiter.velocity).max() > 0.1
    elsewhere = np.full(N, 0.5)
    assert_within([elsewhere] * 3 + [limiter.limit(elsewhere, np.ones(N))], [PERIOD] * 4)


def test_before_the_first_command_it_rests_nowhere():
    limiter = JointLimiter(N, PERIOD)
    assert np.isnan(limiter.resting_point).all()
    limiter.limit(np.ones(N), np.full(N, np.nan))
    np.testing.assert_array_equal(limiter.resting_point, np.ones(N))


def test_it_takes_the_time_that_is_optimal():
    """Oracle: the textbook time of a rest-to-rest move with bounded velocity, acceleration and jerk.

    Where all bounds are reached it is d/v + v/a + a/j (Biagiotti and Melchiorri, Trajectory Planning, 2008, 3.4).
    """
    distance, v, a, j = 2.0, 3.0, 20.0, 1000.0
    ticks = int(np.ceil((distance / v + v / a + a / j) / PERIOD))
    commands = run(JointLimiter(N, PERIOD), np.zeros(N), [np.full(N, distance)] * (ticks + 1))
    assert np.abs(commands[ticks] - distance).max() <= 1e-9
    assert np.abs(commands[ticks - 1] - distance).max() > 1e-9


@pytest.mark.parametrize("frequency", [0.2, 0.5, 1.0])
def test_a_goal_that_moves_is_followed_without_lag(frequency):
    """Within 6 ms. A limiter that only ever aims at rest lags by v / 2a and more, which a hand feels."""
    times = np.arange(0.0, 3.0, PERIOD)
    goals = 0.25 * (1.0 - np.cos(2 * np.pi * frequency * times))
    commands = run(JointLimiter(N, PERIOD), np.zeros(N), [np.full(N, goal) for goal in goals])
    behind = np.abs(np.array(commands[1:])[:, 0] - goals)
    fastest = 0.25 * 2 * np.pi * frequency
    assert behind.max() <= 0.006 * fastest
    assert_within(commands, [PERIOD] * len(commands))


def test_a_goal_seen_more_seldom_than_it_ticks_is_followed_all_the_same():
    times = np.arange(0.0, 3.0, 0.01)
    seen = np.floor(times * 72.0) / 72.0
    goals = 0.5 * (1.0 - np.cos(np.pi * seen))
    commands = run(JointLimiter(N, 0.01), np.zeros(N), [np.full(N, goal) for goal in goals])
    behind = np.array(commands[1:])[:, 0] - 0.5 * (1.0 - np.cos(np.pi * times))
    assert np.sqrt(np.mean(behind**2)) <= 0.015  # at rest only: 0.05


@pytest.mark.parametrize("behind", [4, 12])
def test_a_joint_that_catches_up_does_not_swing_when_the_goal_brakes(behind):
    """The goals of another limiter, some ticks late at first, that brakes as hard as this one may.

    That it brakes is seen a tick or two later, at 0.04 rad a tick; caught up with as fast as can be, it was 0.12 rad.
    """
    path = [np.full(N, 0.04 * k) for k in range(40)] + [np.full(N, np.nan)] * 30
    ahead = run(JointLimiter(N, PERIOD), np.zeros(N), path)
    goals = [*[ahead[0]] * behind, *ahead[behind + 1 :], *[ahead[-1]] * 30]
    commands = run(JointLimiter(N, PERIOD), np.zeros(N), goals)
    assert commands.max() <= ahead.max() + 0.065
    np.testing.assert_allclose(commands[-1], ahead[-1], atol=1e-6)


@given(st.floats(-3.0, 3.0), st.floats(0.0, 1.0), st.integers(1, 40))
def test_a_goal_that_runs_into_the_limit_is_not_followed_beyond(speed, where, gap):
    """Hazard: joint limits. However fast the goal came, and whenever it is lost, the joint stops within its range."""
    lower, upper = np.full(N, -0.5), np.full(N, 0.5)
    limiter = JointLimiter(N, PERIOD, lower=lower, upper=upper, inset=0.05)
    start = np.full(N, where - 0.5) * 0.9
    goals = [start + speed * PERIOD * k for k in range(40)]
    commands = run(limiter, start, [*goals[:gap], *[np.full(N, np.nan)] * 30])
    assert np.abs(commands).max() <= 0.45 + 1e-6
    assert_within(commands, [PERIOD] * len(commands))


def test_a_result_without_a_name_is_no_plan():
    """Found by chance: the planner's Python side raises ValueError for a result it does not know, here -101."""
    limits = MotionLimits(velocity=23.0, acceleration=1.0, jerk=5.0)
    limiter = JointLimiter(N, 0.002, limits)
    commands = run(limiter, np.zeros(N), [np.zeros(N)] * 11 + [np.array([0.0, 0.0, 0.5])] * 10)
    assert_within(commands, [0.002] * len(commands), limits)


class NoPlan:
    """A planner that finds nothing."""

    def calculate(self, plan, trajectory):
        raise ruckig.RuckigError("no plan")


def test_without_a_plan_the_last_one_is_continued_to_its_end():
    limiter = JointLimiter(N, PERIOD)
    commands = run(limiter, np.zeros(N), [np.ones(N)] * 5)
    limiter._planner = NoPlan()
    rest = run(limiter, commands[-1], [np.full(N, -3.0)] * 100)
    assert_within([*commands, *rest[1:]], [PERIOD] * (len(commands) + len(rest) - 1))
    np.testing.assert_allclose(rest[-1], limiter.resting_point, rtol=0, atol=1e-9)
    assert rest[-1][0] > 0.1


def test_without_a_plan_a_joint_that_met_a_moving_goal_brakes():
    limiter = JointLimiter(N, PERIOD)
    commands = run(limiter, np.zeros(N), [np.full(N, 0.02 * k) for k in range(40)])
    assert limiter.velocity[0] > 0.5
    limiter._planner = NoPlan()
    q = np.vstack([commands, run(limiter, commands[-1], [np.ones(N)] * 60)[1:]])
    assert np.abs(np.diff(q, 2, axis=0)).max() <= MotionLimits().acceleration * PERIOD**2 * (1 + 1e-6)
    np.testing.assert_array_equal(q[-1], q[-2])


def test_without_any_plan_it_stays():
    limiter = JointLimiter(N, PERIOD)
    limiter._planner = NoPlan()
    np.testing.assert_array_equal(run(limiter, np.ones(N), [np.zeros(N)] * 3), np.ones((4, N)))


@pytest.mark.parametrize("q", [np.full(N, np.nan), np.zeros(N + 1)])
def test_the_last_command_is_finite(q):
    with pytest.raises(ValueError, match="the last command must be 3 finite numbers"):
        JointLimiter(N, PERIOD).limit(q, np.zeros(N))


@pytest.mark.parametrize(
    ("limits", "what"),
    [
        (MotionLimits(velocity=0.0), "velocity"),
        (MotionLimits(acceleration=np.array([1.0, np.inf, 1.0])), "acceleration"),
        (MotionLimits(jerk=float("nan")), "jerk"),
    ],
)
def test_bounds_are_positive_and_finite(limits, what):
    with pytest.raises(ValueError, match=f"{what} must be positive and finite"):
        JointLimiter(N, PERIOD, limits)


def test_a_joint_needs_a_range():
    with pytest.raises(ValueError, match="leave a joint no range"):
        JointLimiter(N, PERIOD, lower=np.zeros(N), upper=np.full(N, 0.09))


def test_ruckig_is_loaded_with_the_first_limiter_and_its_absence_is_one_line():
    program = """
import sys
import ik_client, ik_client.engagement, ik_client.joint_limiter
assert "ruckig" not in sys.modules
sys.modules["ruckig"] = None
try:
    ik_client.joint_limiter.JointLimiter(3, 0.02)
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "the joint limiter needs ruckig: pip install 'ik-service[teleop]'\n"


ANYTHING = st.floats(-5.0, 5.0) | st.just(np.nan) | st.just(np.inf)
VELOCITIES = st.lists(hnp.arrays(np.float64, 3, elements=ANYTHING), min_size=1, max_size=12)


@given(wanted=VELOCITIES, start=hnp.arrays(np.float64, 3, elements=st.floats(-1.5, 1.5)), uneven=st.booleans())
def test_velocities_are_taken_up_within_all_bounds(wanted, start, uneven):
    """Whatever is wanted, from inside the limits or outside: and what keeps the bounds is taken exactly."""
    period, a_max = 0.005, 20.0
    limiter = JointLimiter(3, period, MotionLimits(), lower=np.full(3, -1.0), upper=np.full(3, 1.0), inset=0.0)
    q, v = start, np.zeros(3)
    for k, velocity in enumerate([*np.repeat(wanted, 8, axis=0), *np.zeros((100, 3))]):
        dt = period * (0.6, 1.0, 1.7)[k % 3] if uneven else period
        before, q = q, limiter.move(q, velocity, dt)
        now = (q - before) / dt
        assert np.abs(now).max() <= 3.0 + 1e-9
        assert np.abs(now - v).max() <= a_max * dt + 1e-9
        low, high = np.minimum(start, -1.0), np.maximum(start, 1.0)
        assert (low - 1e-9 <= q).all()
        assert (q <= high + 1e-9).all()
        outside = (before > 1.0) | (before < -1.0)
        assert (now[outside] * np.sign(before[outside]) <= 1e-12).all()
        goal = np.where(np.isfinite(velocity), velocity, 0.0)
        free = (np.abs(before) < 0.6) & (np.abs(goal) <= 2.0) & (np.abs(goal - v) <= a_max * dt)
        np.testing.assert_allclose(now[free], goal[free], atol=1e-9)
        v = now
    assert np.abs(v).max() < 1e-9  # told to, it has come to rest
