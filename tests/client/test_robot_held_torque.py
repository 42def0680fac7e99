"""The feed-forward torque of the robot's end."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ik_client.robot_end.held_torque import TORQUE_RATE, HeldTorque

DT = 0.02
TORQUES = st.tuples(*[st.floats(-1e6, 1e6)] * 2)


@given(st.lists(st.tuples(TORQUES, st.floats(0.0, 1.0)), max_size=30))
def test_its_rate_is_bounded(steps):
    torque = HeldTorque(2)
    before = torque.value
    for wanted, progress in steps:
        value = torque.step(np.array(wanted), progress, DT)
        assert np.abs(value - before).max() <= TORQUE_RATE * DT * (1 + 1e-9)
        before = value


@given(TORQUES)
def test_it_arrives(wanted):
    torque = HeldTorque(2)
    ticks = int(np.abs(wanted).max() / (TORQUE_RATE * DT)) + 1
    if ticks > 1000:
        wanted, ticks = np.array(wanted) / ticks, 2
    for _ in range(ticks + 1):
        value = torque.step(np.array(wanted), 1.0, DT)
    np.testing.assert_allclose(value, wanted, rtol=1e-9, atol=1e-9)


def test_the_gravity_torque_of_a_moving_arm_passes_unchanged():
    """A load of 12 N m swung at 3 rad/s: its gravity torque changes by 36 N m/s at most."""
    torque = HeldTorque(1)
    angle = 3.0 * DT * np.arange(200)
    wanted = 12.0 * np.sin(angle)
    passed = [torque.step(np.array([tau]), 1.0, DT)[0] for tau in wanted]
    np.testing.assert_allclose(passed, wanted, rtol=0, atol=1e-12)


def test_it_goes_as_far_as_the_joints_do():
    torque = HeldTorque(1)
    assert torque.step(np.array([1.0]), 0.25, DT) == 0.25
    assert torque.step(np.array([1.0]), 0.0, DT) == 0.25


def test_it_can_be_dropped():
    torque = HeldTorque(1)
    torque.step(np.array([1.0]), 1.0, DT)
    torque.reset()
    assert torque.value == 0.0
