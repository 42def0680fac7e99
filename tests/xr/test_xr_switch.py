"""The hold-to-run switch of squeeze and pinch, what must be gripped anew, and what is frozen."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from xr_samples import at, controller, hand, pose

from ik_client.hand import HandSample
from ik_client.hold_to_run import Grip, HoldToRun
from xr_client.freeze_watch import FreezeWatch
from xr_client.grip_switch import GripSwitch
from xr_client.packets import HandPacket, Kind
from xr_client.rearm import Rearm

OPEN, CLOSED, BETWEEN = 0.08, 0.005, 0.02


def pinches(*values: float | None, interval=0.05) -> list[bool | None]:
    switch = GripSwitch()
    return [switch.update(hand(at(), value), k * interval) for k, value in enumerate(values)]


def test_a_squeeze_has_hysteresis():
    switch = GripSwitch()
    values = [0.0, 0.6, 0.7, 0.5, 0.41, 0.39, 0.6, 1.0]
    held = [switch.update(controller(at(), squeeze), 0.0) for squeeze in values]
    assert held == [False, False, True, True, True, False, False, True]


def test_a_pinch_must_last():
    assert pinches(OPEN, CLOSED, CLOSED, CLOSED, CLOSED, CLOSED) == [False, False, False, False, True, True]


def test_touching_fingers_are_no_pinch():
    assert True not in pinches(OPEN, CLOSED, CLOSED, OPEN, CLOSED, CLOSED, OPEN)


def test_a_pinch_has_hysteresis_and_ends_at_once():
    assert pinches(OPEN, *[CLOSED] * 4, BETWEEN, BETWEEN, OPEN, BETWEEN)[4:] == [True, True, True, False, False]


def test_a_pinch_that_was_there_before_the_hand_is_no_press():
    """It counts as held at once: had it to last first, it would look as if it had been open."""
    assert pinches(CLOSED, CLOSED) == [True, True]
    assert pinches(OPEN, None, CLOSED, CLOSED) == [False, None, True, True]
    assert pinches(OPEN, *[CLOSED] * 4, None, CLOSED)[4:] == [True, None, True]


def test_a_controller_without_a_pose_still_has_its_squeeze():
    assert GripSwitch().update(HandPacket(Kind.CONTROLLER, None, squeeze=1.0), 0.0) is True
    assert GripSwitch().update(HandPacket(Kind.NONE), 0.0) is None


@given(st.lists(st.tuples(st.sampled_from(["hand", "controller", "none"]), st.floats(0.0, 1.0)), max_size=40))
def test_a_switch_never_seen_open_is_never_pressed(script):
    """From packets to the loop's own switch: fingers or a squeeze must have been open in the same stretch before."""
    switch, watch, loop = GripSwitch(), Rearm(), HoldToRun()
    stretch, seen_open = "none", False
    for k, (kind, value) in enumerate(script):
        seen = {"hand": hand(at(), value * 0.1), "controller": controller(at(), value), "none": HandPacket()}[kind]
        held = switch.update(seen, 0.05 * k)
        if kind != stretch:
            seen_open = False
        stretch = kind
        seen_open |= (seen.pinch or 0.0) > 0.015 if kind == "hand" else kind == "controller" and seen.squeeze < 0.7
        sample = watch.admit(HandSample(np.eye(4), held, 0.0), kind) if kind != "none" else watch.admit(None, kind)
        if loop.update(sample.grip if sample else None, True) is Grip.PRESSED:
            assert seen_open


def rearmed(*script: tuple[bool | None, object]) -> list[tuple[bool | None, bool]]:
    watch = Rearm()
    got = [watch.admit(HandSample(np.eye(4), grip, 0.0), origin) for grip, origin in script]
    return [(sample.grip, sample.tracked) for sample in got if sample]


def test_a_grip_from_another_room_counts_as_open_until_it_was_open():
    script = [(False, 1), (True, 1), (True, 2), (True, 2), (None, 2), (False, 2), (True, 2)]
    lost, seen = (False, False), (False, True)
    assert rearmed(*script) == [lost, (True, True), lost, seen, seen, seen, (True, True)]


def test_a_grip_held_at_the_beginning_counts_as_open():
    assert rearmed((True, 1), (True, 1), (False, 1), (True, 1)) == [
        (False, False),
        (False, True),
        (False, True),
        (True, True),
    ]


def test_a_hand_out_of_sight_keeps_its_lock():
    watch = Rearm()
    assert watch.admit(None, 1) is None
    sample = watch.admit(HandSample(np.eye(4), True, 0.0), 1)
    assert sample is not None
    assert (sample.grip, sample.tracked) == (False, True)


@given(st.lists(st.tuples(st.sampled_from([True, False, None]), st.integers(0, 2)), max_size=40))
def test_no_grip_survives_a_change_of_origin(script):
    """Whatever happens, the loop is told of a held grip only after it was open in the same origin."""
    watch = Rearm()
    open_since_change, before = False, None
    for grip, origin in script:
        open_since_change = (open_since_change and origin == before) or grip is False
        before = origin
        sample = watch.admit(HandSample(np.eye(4), grip, 0.0), origin)
        assert sample is not None
        assert sample.grip is not True or open_since_change


@pytest.mark.parametrize(("after", "frozen"), [(0.49, False), (0.51, True)])
def test_a_position_that_stays_the_same_to_the_bit_is_frozen(after, frozen):
    watch = FreezeWatch()
    assert not watch.frozen(pose((1, 2, 3))[:3, 3], 10.0)
    assert watch.frozen(pose((1, 2, 3))[:3, 3], 10.0 + after) is frozen
    assert not watch.frozen(pose((1, 2, 3 + 1e-9))[:3, 3], 10.0 + after)
