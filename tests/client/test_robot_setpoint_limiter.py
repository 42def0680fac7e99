"""The bounds of the robot's last limiter, by differences of the set-points it gives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_client import StepLimiter
from ik_client.joint_limiter import JointLimiter, MotionLimits, interval
from ik_client.robot_end.setpoint_limiter import RANGE_INSET, SetpointLimiter

pytest.importorskip("ruckig")

FEW = settings(max_examples=40)
N = 3
PERIOD = 0.02
LIMITS = MotionLimits()
LOWER, UPPER = np.full(N, -1.0), np.full(N, 1.5)
HOLD = np.full(N, np.nan)


def assert_within(setpoints, intervals, limits=LIMITS):
    """Velocity and acceleration, as differences, from a rest before the first of them."""
    q = np.array([setpoints[0], setpoints[0], *setpoints])
    dt = np.array([PERIOD, *intervals])[:, None]
    rounding = 4.0 * np.spacing(np.abs(q).max())
    v = np.diff(q, axis=0) / dt
    a = np.diff(v, axis=0) / (0.5 * (dt[1:] + dt[:-1]))
    assert np.abs(v).max() <= limits.velocity * (1 + 2e-6) + rounding / dt.min()
    assert np.abs(a).max() <= limits.acceleration * (1 + 2e-6) + 4 * rounding / dt.min() ** 2


def run(limiter, start, commands, intervals=None):
    limiter.start(np.array(start, dtype=float))
    setpoints = [limiter.q]
    for k, command in enumerate(commands):
        setpoints.append(limiter.step(np.asarray(command, dtype=float), None if intervals is None else intervals[k]))
    assert np.isfinite(setpoints).all()
    return np.array(setpoints)


def of_a_loop(start, goals, limits=LIMITS, **options):
    """The commands of a loop that keeps the bounds."""
    limiter, q = JointLimiter(N, PERIOD, limits, **options), np.array(start, dtype=float)
    commands = []
    for goal in goals:
        q = limiter.limit(q, np.asarray(goal, dtype=float))
        commands.append(q)
    return commands


WILD = st.floats(-3.0, 3.0) | st.floats() | st.sampled_from([np.nan, np.inf, -np.inf, 1e308, 0.0, 5e-324])
NEAR = st.floats(-0.1, 0.1)
START = st.tuples(*[st.floats(-3.0, 3.0)] * N)
GOALS = st.lists(st.tuples(st.tuples(*[st.floats(-3.0, 3.0)] * N), st.integers(1, 15)), min_size=1, max_size=6).map(
    lambda parts: [goal for goal, ticks in parts for _ in range(ticks)]
)


@st.composite
def streams(draw):
    """A loop's commands as a bad day delivers them: gaps, bursts, repeats, jumps, noise, and what is no number."""
    start = draw(START)
    commands = of_a_loop(start, draw(GOALS))
    delivered = []
    k = 0
    while k < len(commands) and len(delivered) < 80:
        match draw(st.sampled_from(["next"] * 6 + ["repeat", "skip", "wild", "jump", "noise", "hold"])):
            case "next":
                delivered.append(commands[k])
            case "repeat":
                delivered += [commands[k]] * draw(st.integers(1, 6))
            case "skip":
                k += draw(st.integers(1, 10))
            case "wild":
                delivered.append(np.array(draw(st.tuples(*[WILD] * N))))
            case "jump":
                delivered.append(commands[k] + np.array(draw(st.tuples(*[NEAR] * N))))
            case "noise":
                delivered.append(commands[k] + draw(st.floats(-1e-4, 1e-4)))
            case "hold":
                delivered += [HOLD] * draw(st.integers(1, 10))
        k += 1
    return start, delivered


@FEW
@given(streams())
def test_velocity_and_acceleration_are_bounded_for_every_stream(stream):
    """Hazard rows "velocity / acceleration / jerk" and "first frame", at the robot."""
    start, commands = stream
    setpoints = run(SetpointLimiter(N, PERIOD), start, commands)
    assert_within(setpoints, [PERIOD] * len(setpoints))


@FEW
@given(streams(), st.data())
def test_the_bounds_hold_at_uneven_ticks(stream, data):
    start, commands = stream
    anything = st.floats(0.0, 3.0 * PERIOD) | st.sampled_from([0.0, -1.0, np.nan, np.inf, 1e9])
    intervals = data.draw(st.lists(anything, min_size=len(commands), max_size=len(commands)))
    setpoints = run(SetpointLimiter(N, PERIOD), start, commands, intervals)
    assert_within(setpoints, [PERIOD, *[interval(dt, PERIOD) for dt in intervals]])


@FEW
@given(
    streams(),
    st.floats(0.2, 10.0),
    st.floats(2.0, 100.0),
    st.floats(50.0, 10_000.0),
)
def test_any_bounds_are_kept(stream, velocity, acceleration, jerk):
    start, commands = stream
    limits = MotionLimits(velocity, acceleration, jerk)
    setpoints = run(SetpointLimiter(N, PERIOD, limits), start, commands)
    assert_within(setpoints, [PERIOD] * len(setpoints), limits)


@FEW
@given(streams())
def test_set_points_stay_within_the_joint_limits(stream):
    """Hazard row "joint limits", at the robot: what begins inside stays inside, commands and braking alike."""
    start, commands = stream
    start = np.clip(start, LOWER + RANGE_INSET, UPPER - RANGE_INSET)
    setpoints = run(SetpointLimiter(N, PERIOD, lower=LOWER, upper=UPPER), start, [*commands, *[HOLD] * 20])
    assert (setpoints >= LOWER).all()
    assert (setpoints <= UPPER).all()
    assert_within(setpoints, [PERIOD] * len(setpoints))


@FEW
@given(START, streams())
def test_from_outside_the_joint_limits_it_moves_inward_only(start, stream):
    """Hazard row "joint limits", at the robot."""
    setpoints = run(SetpointLimiter(N, PERIOD, lower=LOWER, upper=UPPER), start, stream[1])
    outside = np.maximum(np.maximum(LOWER + RANGE_INSET - setpoints, setpoints - UPPER + RANGE_INSET), 0.0)
    assert (np.diff(outside, axis=0) <= 1e-7).all()


@FEW
@given(START, GOALS)
def test_commands_that_keep_the_bounds_are_taken_exactly(start, goals):
    commands = of_a_loop(start, goals)
    setpoints = run(SetpointLimiter(N, PERIOD), start, commands)
    np.testing.assert_array_equal(setpoints[1:], commands)


@FEW
@given(st.tuples(*[st.floats(-0.9, 1.4)] * N), GOALS)
def test_a_loop_that_keeps_a_wider_inset_is_followed_exactly_up_to_its_joint_limits(start, goals):
    commands = of_a_loop(start, goals, lower=LOWER, upper=UPPER, inset=0.08)
    setpoints = run(SetpointLimiter(N, PERIOD, lower=LOWER, upper=UPPER), start, commands)
    np.testing.assert_array_equal(setpoints[1:], commands)


@FEW
@given(streams())
def test_without_commands_it_comes_to_rest_and_stays(stream):
    """Hazard row "stale target", at the robot: at rest within v / a + a / j, whatever came before."""
    start, commands = stream
    limiter = SetpointLimiter(N, PERIOD)
    setpoints = run(limiter, start, commands)
    stop = int((LIMITS.velocity / LIMITS.acceleration + 2 * LIMITS.acceleration / LIMITS.jerk) / PERIOD) + 2
    rest = [limiter.step(HOLD) for _ in range(stop + 20)]
    assert_within([*setpoints, *rest], [PERIOD] * (len(setpoints) + len(rest)))
    assert np.ptp(rest[stop:], axis=0).max() <= 1e-9


@FEW
@given(streams(), START)
def test_it_arrives_whatever_came_before(stream, goal):
    limiter = SetpointLimiter(N, PERIOD)
    run(limiter, *stream)
    for _ in range(250):
        q = limiter.step(np.array(goal))
    np.testing.assert_allclose(q, goal, rtol=0, atol=1e-9)


def test_one_lost_command_is_caught_up_with_at_once():
    """A loop at two thirds of the bound; one of its commands does not come in time and the next one does."""
    commands = of_a_loop(np.zeros(N), [np.full(N, 5.0)] * 60, MotionLimits(2.0, 10.0, 500.0))
    late = [*commands[:30], commands[29], *commands[31:]]
    setpoints = run(SetpointLimiter(N, PERIOD), np.zeros(N), late)[1:]
    assert np.abs(setpoints - commands).max() < 0.016  # a tick at this speed is 0.04 rad
    np.testing.assert_array_equal(setpoints[50:], commands[50:])


def test_commands_that_come_late_now_and_then_do_not_make_it_swing():
    """Two loops that are not in step: what catches up must not be taken at a command it only passes."""
    commands = np.array(of_a_loop(np.zeros(N), [np.full(N, 0.6)] * 30 + [np.full(N, -0.4)] * 60))
    settled = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        newest, late = 0, []
        for k in range(len(commands)):
            newest = max(newest, k - int(rng.random() < 0.3))
            late.append(commands[newest])
        setpoints = run(SetpointLimiter(N, PERIOD), np.zeros(N), [*late, *[commands[-1]] * 30])[1:]
        speed = np.abs(np.diff(np.array(setpoints)[:, 0]))
        moving = np.flatnonzero(speed > 1e-6)
        settled.append((moving[-1] - np.flatnonzero(np.abs(np.diff(commands[:, 0])) > 1e-6)[-1]) * PERIOD)
    assert max(settled) <= 0.35  # it was 0.9 s


def test_without_the_check_of_the_bounds_the_property_would_fail():
    """The negative control: what a clip of the velocity alone would let through."""
    clip, q = StepLimiter(3.0 * PERIOD), np.zeros(N)
    setpoints = [q, *(q := clip.limit(q, np.ones(N)) for _ in range(10))]
    with pytest.raises(AssertionError):
        assert_within(setpoints, [PERIOD] * len(setpoints))


@pytest.mark.parametrize(
    ("dt", "counts"), [(None, 0.02), (0.015, 0.015), (0.0, 0.01), (-1.0, 0.01), (np.nan, 0.01), (9.0, 0.04)]
)
def test_a_tick_counts_for_no_less_than_half_a_period_and_no_more_than_two(dt, counts):
    assert interval(dt, PERIOD) == counts
