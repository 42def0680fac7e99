"""The hold-to-run switch: only a witnessed, deliberate press counts."""

from hypothesis import given
from hypothesis import strategies as st

from ik_client.hold_to_run import Grip, HoldToRun

R, P, H = Grip.RELEASED, Grip.PRESSED, Grip.HELD


def run(*ticks):
    """Outputs for (held, followable) or just held, with a hand that can be followed."""
    switch = HoldToRun()
    return [switch.update(*(tick if isinstance(tick, tuple) else (tick, True))) for tick in ticks]


def test_a_press_counts_once_and_is_held_until_let_go():
    assert run(False, True, True, True, False, True) == [R, P, H, H, R, P]


def test_held_at_the_start_arms_nothing():
    """Hazard row "deadman release": held at boot."""
    assert run(True, True, True, False, True) == [R, R, R, R, P]


def test_held_when_the_link_comes_back_arms_nothing():
    """Hazard row "deadman release": held at reconnect. The press was not seen."""
    assert run(False, None, True, True, False, True) == [R, R, R, R, R, P]


def test_a_gap_does_not_let_go():
    assert run(False, True, None, None, True, False) == [R, P, H, H, H, R]


def test_a_press_with_a_lost_hand_is_void_until_let_go():
    assert run(False, (True, False), (True, True), True, False, True) == [R, R, R, R, R, P]


def test_chatter_is_a_press_each_time():
    """Hazard row "deadman release": chatter. Every closing is a new press, so nothing goes on by itself."""
    assert run(False, True, False, True, False, True) == [R, P, R, P, R, P]


@given(st.lists(st.tuples(st.sampled_from([True, False, None]), st.booleans()), max_size=40))
def test_every_hold_goes_back_to_a_witnessed_press(ticks):
    outputs = run(*ticks)
    for k, output in enumerate(outputs):
        held, followable = ticks[k]
        if held is False:
            assert output is R
        if output is P:
            assert k > 0
            assert ticks[k - 1][0] is False
            assert held is True
            assert followable
        if output is H:
            assert outputs[k - 1] in (P, H)
