"""The guard: whose commands move the arms and when, whatever comes and whatever stays away."""

import numpy as np
import pytest
from guard_bench import HOME, PERIOD, TICKS_OF_THE_RAMP, Bench, N, ramp_towards, speed

from ik_client.robot_end import EndState
from ik_client.robot_end.guard import AGREEMENT, DISARM_AFTER, HOLD_AFTER

pytest.importorskip("ruckig")

HOLD_TICKS, DISARM_TICKS = round(HOLD_AFTER / PERIOD), round(DISARM_AFTER / PERIOD)
AWAY = np.array([0.3, 0.2, -0.4])


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_it_starts_released_and_stays_so_without_commands(bench):
    setpoint = bench.tick(100)
    assert (setpoint.state, setpoint.weight) == (EndState.RELEASED, 0.0)
    state = bench.guard.report(bench.q, np.zeros(N), bench.now, None)
    assert (state.ready, state.following, state.q_set) == (False, False, None)


def test_taking_moves_nothing(bench):
    """Hazard rows "weight ramp / exit" and "first frame": the weight rises on arms that stay where they are."""
    for k in range(TICKS_OF_THE_RAMP):
        setpoint = bench.go(1, HOME + 0.09)
        assert setpoint.weight == pytest.approx((k + 1) / TICKS_OF_THE_RAMP)
        np.testing.assert_array_equal(setpoint.q, HOME)
    assert bench.state is EndState.READY


def test_commands_that_do_not_agree_with_the_arms_take_nothing(bench):
    """Hazard row "first frame"."""
    bench.go(50, HOME + np.array([0.0, AGREEMENT + 0.001, 0.0]))
    assert bench.state is EndState.RELEASED
    assert bench.setpoints[-1].weight == 0.0
    bench.go(1, HOME + np.array([0.0, AGREEMENT - 0.001, 0.0]))
    assert bench.state is EndState.TAKING


def test_arms_that_cannot_be_measured_are_not_taken(bench):
    bench.q = np.full(N, np.nan)
    bench.tick()
    bench.send(HOME)
    bench.send(np.zeros(N))
    assert bench.state is EndState.RELEASED


def test_ready_arms_do_not_follow(bench):
    bench.take()
    bench.go(50, HOME + 0.5)
    np.testing.assert_array_equal(bench.q_set, HOME)
    assert bench.state is EndState.READY


def test_an_engagement_that_rises_on_ready_arms_is_followed(bench):
    bench.follow()
    bench.go(100, HOME + AWAY, engaged=True)
    np.testing.assert_allclose(bench.q_set, HOME + AWAY, rtol=0, atol=1e-9)


def test_an_engagement_that_was_there_before_is_not(bench):
    """Hazard row "deadman release", at the robot: held at the start does not arm."""
    bench.go(TICKS_OF_THE_RAMP + 50, engaged=True)
    assert bench.state is EndState.READY
    bench.go(1, engaged=False)
    bench.go(1, engaged=True)
    assert bench.state is EndState.FOLLOWING


def test_an_engagement_far_from_where_the_arms_are_held_does_not_count(bench):
    """Hazard row "first frame", at the robot."""
    bench.take()
    bench.go(50, HOME + AWAY, engaged=True)
    assert bench.state is EndState.READY
    assert "engage again" in bench.setpoints[-1].note
    np.testing.assert_array_equal(bench.q_set, HOME)
    bench.go(1)
    bench.go(1, engaged=True)
    assert bench.state is EndState.FOLLOWING
    assert bench.setpoints[-1].note == ""


def test_disengaging_brakes_and_holds(bench):
    bench.follow()
    ramp_towards(bench, 20)
    assert speed(bench) == pytest.approx(1.0)
    bench.go(20, HOME + 3.0, engaged=False)
    assert bench.state is EndState.READY
    assert speed(bench) < 1e-9
    assert bench.guard.tally["disarmed"] == 0


@pytest.mark.parametrize(
    ("ticks", "state"),
    [
        (HOLD_TICKS, EndState.FOLLOWING),
        (HOLD_TICKS + 1, EndState.HOLDING),
        (DISARM_TICKS, EndState.HOLDING),
        (DISARM_TICKS + 1, EndState.READY),
    ],
)
def test_silence_holds_and_then_disarms(bench, ticks, state):
    """Hazard rows "stale target" and "lost connection", at the robot: the boundaries, to a tick."""
    bench.follow()
    ramp_towards(bench, 20)
    bench.now -= 1e-6  # Or rounding decides on the boundary itself.
    bench.tick(ticks - 1)  # The last command is a tick old already.
    assert bench.state is state
    assert bench.setpoints[-1].weight == 1.0


def test_silence_for_ever_is_a_hold_for_ever(bench):
    """Hazard row "service crash": the weight stays, and so does the torque."""
    bench.follow()
    ramp_towards(bench, 20, tau=np.array([3.0, -2.0, 1.0]))
    bench.tick(20)
    held = bench.q_set
    setpoint = bench.tick(1000)
    assert (setpoint.state, setpoint.weight) == (EndState.READY, 1.0)
    np.testing.assert_allclose(setpoint.q, held, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(setpoint.tau, [3.0, -2.0, 1.0])


def test_after_a_short_silence_a_fresh_command_goes_on(bench):
    bench.follow()
    ramp_towards(bench, 10)
    bench.tick(HOLD_TICKS + 5)
    assert bench.state is EndState.HOLDING
    bench.go(50, HOME + AWAY, engaged=True)
    assert bench.state is EndState.FOLLOWING
    np.testing.assert_allclose(bench.q_set, HOME + AWAY, rtol=0, atol=1e-9)


def test_after_a_long_silence_nothing_moves_before_a_new_engagement(bench):
    """Hazard row "lost connection": re-entry needs a deliberate grip."""
    bench.follow()
    ramp_towards(bench, 10)
    bench.tick(DISARM_TICKS + 2)
    held = bench.q_set
    bench.go(50, held + 0.05, engaged=True)
    np.testing.assert_array_equal(bench.q_set, held)
    bench.go(1, engaged=False)
    bench.go(2, held, engaged=True)
    assert bench.state is EndState.FOLLOWING


def test_a_burst_after_a_silence_is_no_engagement(bench):
    """What a network held back and delivers at once ends with `engaged`; only its beginning was disarmed."""
    bench.follow()
    bench.go(5, engaged=False)
    bench.tick(DISARM_TICKS + 2)
    for _ in range(20):
        bench.send(engaged=True)
    bench.tick()
    assert bench.state is EndState.READY


@pytest.mark.parametrize("by_command", [True, False])
@pytest.mark.parametrize("phase", ["taking", "ready", "following", "holding", "braking", "releasing"])
def test_the_weight_sinks_to_nothing_from_every_phase(bench, phase, by_command):
    """Hazard row "weight ramp / exit": a release, and the end of the program, at every phase."""
    match phase:
        case "taking":
            bench.go(TICKS_OF_THE_RAMP // 2)
        case "ready":
            bench.take()
        case _:
            bench.follow()
            ramp_towards(bench, 20)
    if phase in ("holding", "braking"):
        bench.tick(HOLD_TICKS + (10 if phase == "holding" else 2))
    if phase == "releasing":
        bench.go(3, release=True)
    begin, before = len(bench.setpoints), bench.setpoints[-1].weight
    if by_command:
        bench.send(release=True)
    else:
        bench.guard.release()
    ticks = round(before * TICKS_OF_THE_RAMP)
    for k in range(ticks):
        assert bench.state is EndState.RELEASING, k
        bench.go(1, HOME, engaged=bool(k % 2))  # A loop that goes on does not stop it.
    assert bench.state is EndState.RELEASED
    weights = [setpoint.weight for setpoint in bench.setpoints[begin - 1 :]]
    np.testing.assert_allclose(np.diff(weights), -1.0 / TICKS_OF_THE_RAMP, atol=1e-9)
    assert weights[-1] == 0.0
    assert bench.guard.weight == 0.0


def test_after_the_end_of_the_program_no_command_takes_the_arms_again(bench):
    bench.take()
    bench.guard.release()
    bench.go(TICKS_OF_THE_RAMP + 50)
    assert bench.state is EndState.RELEASED


def test_the_end_of_the_program_before_any_command_takes_no_time(bench):
    bench.guard.release()
    assert bench.tick().weight == 0.0
    assert bench.state is EndState.RELEASED


def test_a_late_tick_moves_the_weight_by_two_periods_at_most(bench):
    bench.go(1)
    before = bench.guard.weight
    bench.send()
    setpoint = bench.guard.step(bench.now + 30.0, bench.q, 30.0)
    assert setpoint.weight == pytest.approx(before + 2.0 / TICKS_OF_THE_RAMP)


def test_the_torque_of_commands_is_followed_with_their_joints(bench):
    bench.follow()
    tau = np.array([4.0, -4.0, 0.5])
    bench.go(1, tau=tau, engaged=True)
    np.testing.assert_allclose(bench.setpoints[-1].tau, [2.0, -2.0, 0.5])  # at 100 N m/s
    bench.go(20, tau=tau, engaged=True)
    np.testing.assert_array_equal(bench.setpoints[-1].tau, tau)


def test_while_held_the_torque_of_a_source_elsewhere_is_not_taken(bench):
    """The torque of a hold is that of where the arms are held, as far as the commands tell."""
    bench.follow()
    here, elsewhere = np.array([4.0, -4.0, 0.5]), np.array([9.0, 9.0, 9.0])
    bench.go(20, tau=here, engaged=True)
    bench.go(50, HOME + AWAY, tau=elsewhere, engaged=False)
    np.testing.assert_array_equal(bench.setpoints[-1].tau, here)
    bench.go(50, tau=here + 1.0, engaged=False)
    np.testing.assert_array_equal(bench.setpoints[-1].tau, here + 1.0)


def test_a_loop_that_begins_does_not_make_the_arms_sag(bench):
    """Hazard row "service crash", of the operator's program: its successor knows no torque yet, and is not followed."""
    bench.follow()
    tau = np.array([3.0, -2.0, 1.0])
    bench.go(20, tau=tau)
    np.testing.assert_array_equal(bench.setpoints[-1].tau, tau)
    bench.tick(60)
    held = bench.setpoints[-1]
    state = bench.guard.report(bench.q, np.zeros(N), 0.0, None)
    np.testing.assert_array_equal(state.tau_set, tau)  # where it may begin
    bench.go(20, session="b", tau=np.zeros(N))
    np.testing.assert_array_equal(bench.setpoints[-1].tau, held.tau)
    bench.go(1, session="b", tau=np.zeros(N), engaged=True)
    bench.go(20, session="b", tau=np.zeros(N), engaged=True)
    np.testing.assert_array_equal(bench.setpoints[-1].tau, np.zeros(N))  # once followed, it is its torque that counts


def test_measured_joints_of_another_robot_are_a_mistake(bench):
    with pytest.raises(ValueError, match="3 measured joints are needed"):
        bench.guard.step(bench.now, np.zeros(N + 1))
