"""The ramp of authority."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_client.authority import Authority
from ik_client.state_machine import ArmState


def test_it_rises_within_a_second_and_not_sooner():
    authority = Authority()
    values = [authority.update(ArmState.ACTIVE, k / 100) for k in range(121)]
    assert values[0] == 0.0
    assert values[50] == pytest.approx(0.5)
    assert values[99] < 1.0
    assert values[101] == 1.0


def test_a_hold_takes_it_back_and_a_glitch_takes_little():
    authority = Authority(rise=1.0, fall=0.5)
    authority.update(ArmState.ACTIVE, 0.0)
    authority.update(ArmState.ACTIVE, 2.0)
    assert authority.update(ArmState.HOLD, 2.01) == pytest.approx(0.98)
    assert authority.update(ArmState.HOLD, 2.5) == pytest.approx(0.0)


@pytest.mark.parametrize("state", [ArmState.DISARMED, ArmState.ALIGNING, ArmState.FAULT])
def test_no_other_state_has_any(state):
    authority = Authority()
    authority.update(ArmState.ACTIVE, 0.0)
    authority.update(ArmState.ACTIVE, 5.0)
    assert authority.update(state, 5.0) == 0.0


@given(st.lists(st.tuples(st.sampled_from(list(ArmState)), st.floats(-0.2, 0.2)), max_size=30))
def test_it_stays_within_bounds_and_never_rises_faster_than_its_ramp(ticks):
    authority, now = Authority(rise=1.0), 0.0
    before = authority.update(ArmState.DISARMED, now)
    for state, passed in ticks:
        now += passed
        value = authority.update(state, now)
        assert 0.0 <= value <= 1.0
        assert value - before <= max(passed, 0.0) + 1e-12
        if state is not ArmState.ACTIVE:
            assert value <= before
        before = value


@pytest.mark.parametrize(("rise", "fall"), [(0.0, 1.0), (1.0, -1.0), (float("nan"), 1.0)])
def test_times_are_positive(rise, fall):
    with pytest.raises(ValueError, match="positive time"):
        Authority(rise, fall)
