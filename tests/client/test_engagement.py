"""One arm from hand to target: the hazards, tick by tick."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_client.clutch import Clutch
from ik_client.engagement import ArmEngagement, ArmStep
from ik_client.gate import Verdict
from ik_client.hand import HandSample
from ik_client.rotation import turn
from ik_client.state_machine import ArmState, Event

TICK = 0.01
WRIST = np.eye(4)
WRIST[:3, 3] = [0.3, 0.2, 0.1]


def pose(x=0.0):
    T = np.eye(4)
    T[0, 3] = x
    return T


class Operator:
    """A hand that moves at a constant speed, and an arm that does as it is told."""

    def __init__(self, **parts) -> None:
        self.arm = ArmEngagement(**parts)
        self.now = 50.0
        self.count = 0
        self.x = 0.0
        self.wrist = WRIST
        self.snapshots = 0

    def snapshot(self):
        self.snapshots += 1
        return self.wrist

    def tick(self, grip: bool | None = True, *, move=0.001, aligned=True, **conditions) -> ArmStep:
        self.x += move
        self.count += 1
        return self.offer(HandSample(pose(self.x), grip, self.count), aligned=aligned, **conditions)

    def offer(self, sample, *, aligned=True, dt=TICK, **conditions) -> ArmStep:
        self.now += dt
        before = self.arm.state
        step = self.arm.step(sample, self.now, wrist=self.snapshot, aligned=aligned, **conditions)
        assert step.state is self.arm.state
        assert self.arm._clutch.engaged == (step.state is ArmState.ACTIVE)
        assert (step.target is not None) == (step.state is ArmState.ACTIVE) == (step.reason == "")
        if step.target is not None:
            if before is not ArmState.ACTIVE:
                np.testing.assert_allclose(step.target, self.wrist, rtol=0, atol=1e-12)
            self.wrist = step.target
        return step

    def engage(self) -> ArmStep:
        self.tick(False)
        self.tick(True)
        return self.tick(True)


def test_a_deliberate_grip_engages_and_the_wrist_follows():
    operator = Operator()
    assert operator.arm.state is ArmState.DISARMED
    assert operator.tick(False).reason == "not engaged: grip to engage"
    assert operator.tick(True).state is ArmState.ALIGNING
    assert operator.tick(True).state is ArmState.ACTIVE
    for _ in range(150):
        step = operator.tick()
    assert step.authority == 1.0
    before, x = operator.wrist.copy(), operator.x
    for _ in range(100):
        operator.tick()
    np.testing.assert_allclose(operator.wrist[:3, 3] - before[:3, 3], [operator.x - x, 0.0, 0.0], rtol=0, atol=1e-12)


def test_held_at_start_does_not_arm():
    """Hazard row "deadman release": held at boot."""
    operator = Operator()
    assert {operator.tick(True).state for _ in range(300)} == {ArmState.DISARMED}
    assert operator.engage().state is ArmState.ACTIVE


def test_letting_go_holds_in_the_same_tick_and_going_on_needs_a_new_grip():
    """Hazard row "deadman release": release mid-motion; a re-grip takes a fresh snapshot."""
    operator = Operator()
    operator.engage()
    step = operator.tick(False)
    assert step.state is ArmState.HOLD
    assert step.reason == "the grip was released"
    assert operator.tick(False, move=0.05).state is ArmState.HOLD
    assert operator.tick(True, move=0.05).state is ArmState.ALIGNING
    assert operator.tick(True, move=0.05).state is ArmState.ACTIVE  # Operator.offer checks its target
    assert operator.snapshots == 2


def test_letting_go_for_long_disarms():
    operator = Operator()
    operator.engage()
    states = [operator.tick(False).state for _ in range(60)]
    assert states[:50] == [ArmState.HOLD] * 50
    assert states[-1] is ArmState.DISARMED


def test_chatter_never_goes_on_without_alignment():
    """Hazard row "deadman release": chatter."""
    operator = Operator()
    operator.engage()
    for _ in range(20):
        assert operator.tick(False).state is ArmState.HOLD
        assert operator.tick(True).state is ArmState.ALIGNING
        assert operator.tick(True).state is ArmState.ACTIVE


def test_a_tracker_that_says_nothing_holds_in_the_same_tick_and_short_gaps_go_on():
    """Hazard row "deadman release": a missing switch counts as open for this tick."""
    operator = Operator()
    operator.engage()
    assert operator.offer(None).state is ArmState.HOLD
    assert operator.tick(None).state is ArmState.ACTIVE  # the hand is back; nothing was let go
    assert operator.snapshots == 2


def test_silence_holds_after_a_tenth_and_disarms_after_half_a_second():
    """Hazard rows "stale target" and "lost connection": a sender that stops looks the same as a broken link."""
    operator = Operator()
    operator.engage()
    last = HandSample(pose(operator.x + 0.001), True, 999)
    states = [operator.offer(last).state for _ in range(70)]
    assert set(states[:10]) == {ArmState.ACTIVE}
    assert set(states[12:50]) == {ArmState.HOLD}
    assert set(states[52:]) == {ArmState.DISARMED}
    assert operator.tick(True).state is ArmState.DISARMED  # still gripped: not deliberate
    assert operator.engage().state is ArmState.ACTIVE


def test_a_short_loss_goes_on_from_where_the_arm_is():
    """Hazard row "first frame / re-clutch": after a drop-out of 128 ms the hand is elsewhere and the wrist is not."""
    operator = Operator()
    operator.engage()
    last = HandSample(pose(operator.x), True, operator.count)
    assert operator.offer(last, dt=0.128).state is ArmState.HOLD
    step = operator.tick(move=0.2)
    while step.state is ArmState.HOLD:
        step = operator.tick()
    assert step.state is ArmState.ACTIVE
    assert operator.snapshots == 2


def test_a_glitch_costs_a_tick_and_hardly_any_authority():
    """Hazard row "teleporting target"."""
    operator = Operator()
    operator.engage()
    for _ in range(120):
        operator.tick()
    assert operator.tick(move=0.73).state is ArmState.HOLD
    step = operator.tick(move=-0.73)
    assert step.state is ArmState.ACTIVE
    assert step.authority > 0.95


def test_a_hand_that_is_somewhere_else_needs_a_new_grip():
    """Hazard row "teleporting target": consistent frames at the new place do not resume."""
    operator = Operator()
    operator.engage()
    states = [operator.tick(move=0.7 if k == 0 else 0.001).state for k in range(100)]
    assert states[:2] == [ArmState.HOLD, ArmState.HOLD]
    assert set(states[2:]) == {ArmState.DISARMED}
    assert operator.engage().state is ArmState.ACTIVE


def test_it_waits_for_agreement_and_gives_up():
    """Hazard row "first frame / re-clutch": command and measurement must agree before anything moves."""
    operator = Operator()
    operator.tick(False)
    states = [operator.tick(True, aligned=False).state for _ in range(100)]
    assert set(states) == {ArmState.ALIGNING}
    assert operator.tick(True, aligned=True).state is ArmState.ACTIVE
    operator = Operator()
    operator.tick(False)
    steps = [operator.tick(True, aligned=False) for _ in range(250)]
    assert steps[-1].state is ArmState.DISARMED
    assert steps[-1].reason == "aligning for too long"


def test_a_loss_while_aligning_needs_a_new_grip():
    operator = Operator()
    operator.tick(False)
    operator.tick(True, aligned=False)
    assert operator.offer(None).state is ArmState.DISARMED
    assert operator.tick(True).state is ArmState.DISARMED


def test_authority_rises_from_nothing():
    """Hazard row "first frame / re-clutch": the ramp of 1 s."""
    operator = Operator()
    assert operator.engage().authority < 0.02
    x, wrist = operator.x, operator.wrist.copy()
    for _ in range(50):
        step = operator.tick()
    assert step.authority == pytest.approx(0.5, abs=0.02)
    way = operator.wrist[0, 3] - wrist[0, 3]
    assert 0.2 * (operator.x - x) < way < 0.3 * (operator.x - x)


def test_another_service_moves_nothing_before_a_new_grip():
    """Hazard row "service restart": a changed boot_id revokes the grip."""
    operator = Operator()
    operator.engage()
    step = operator.tick(revoked="another service answers")
    assert step.state is ArmState.DISARMED
    assert step.reason == "another service answers"
    assert {operator.tick(True).state for _ in range(300)} == {ArmState.DISARMED}
    assert operator.engage().state is ArmState.ACTIVE


def test_a_service_that_fails_holds_and_then_disarms():
    """Hazard rows "solver failure" and "lost connection"."""
    operator = Operator()
    operator.engage()
    step = operator.tick(trouble="10 solves in a row failed")
    assert step.state is ArmState.HOLD
    assert step.reason == "10 solves in a row failed"
    assert operator.tick().state is ArmState.ACTIVE
    assert [operator.tick(trouble="no service").state for _ in range(60)][-1] is ArmState.DISARMED
    assert operator.tick().state is ArmState.DISARMED


def test_a_press_while_the_service_is_silent_is_void():
    operator = Operator()
    operator.tick(False)
    assert operator.tick(True, trouble="no service").state is ArmState.DISARMED
    assert operator.tick(True).state is ArmState.DISARMED


def test_a_fault_is_latched_until_cleared_and_gripped_anew():
    operator = Operator()
    operator.engage()
    assert operator.tick(fault="elbow hot").reason == "elbow hot"
    for grip in (True, False, True, True, None):
        step = operator.tick(grip)
        assert step.state is ArmState.FAULT
        assert step.reason == "elbow hot"
    assert operator.tick(True, fault="elbow hot", clear=True).state is ArmState.FAULT
    assert operator.tick(True, clear=True).state is ArmState.DISARMED
    assert {operator.tick(True).state for _ in range(20)} == {ArmState.DISARMED}
    assert operator.engage().state is ArmState.ACTIVE


def test_a_fault_can_be_cleared_while_there_is_no_hand():
    operator = Operator()
    operator.tick(fault="elbow hot")
    assert operator.offer(None, dt=1.0).state is ArmState.FAULT
    assert operator.offer(None, clear=True).state is ArmState.DISARMED


@pytest.mark.parametrize("grip", [True, False])
def test_stop_has_stopped_when_it_returns(grip):
    """Hazard row "stop path broken"."""
    operator = Operator()
    operator.engage()
    operator.tick(grip)
    step = operator.arm.stop(operator.now)
    assert operator.arm.state is step.state is ArmState.DISARMED
    assert step.target is None
    assert step.reason == "stopped"
    assert step.authority == 0.0
    assert operator.tick(True).target is None
    assert operator.engage().state is ArmState.ACTIVE


def test_stop_does_not_clear_a_fault():
    operator = Operator()
    operator.tick(fault="elbow hot")
    assert operator.arm.stop(operator.now).state is ArmState.FAULT


@pytest.mark.parametrize("wrist", [np.full((4, 4), np.nan), np.zeros((4, 4)), 1 / 3, OSError("no\nanswer")])
def test_without_a_snapshot_it_does_not_start(wrist):
    operator = Operator()

    def snapshot():
        if isinstance(wrist, Exception):
            raise wrist
        return wrist

    operator.tick(False)
    operator.tick(True)
    operator.count += 1
    sample = HandSample(pose(0.003), True, operator.count)
    step = operator.arm.step(sample, operator.now + TICK, wrist=snapshot, aligned=True)
    assert step.state is ArmState.DISARMED
    assert step.event is Event.LOST
    assert step.reason.startswith("no snapshot of the wrist")
    assert "\n" not in step.reason


def test_the_scale_is_the_clutch_s():
    operator = Operator(clutch=Clutch(0.5))
    operator.engage()
    for _ in range(120):
        operator.tick()
    before, x = operator.wrist[0, 3], operator.x
    operator.tick(move=0.01)
    assert operator.wrist[0, 3] - before == pytest.approx(0.5 * (operator.x - x))


WHAT = st.sampled_from(["move", "move", "move", "still", "glitch", "leap", "nan", "untracked", "nothing", "repeat"])
GRIP = st.sampled_from([True, True, True, True, False, None])
DT = st.sampled_from([0.01, 0.01, 0.01, 0.02, 0.09, 0.2, 0.7])
CONDITIONS = st.sampled_from([{}, {}, {}, {}, {"trouble": "t"}, {"revoked": "r"}, {"fault": "f"}, {"clear": True}])


@given(st.lists(st.tuples(WHAT, GRIP, DT, CONDITIONS, st.booleans()), max_size=80))
def test_whatever_happens_the_target_never_leaps(ticks):
    """The promise to the solver: no step of the wrist's target is longer than a hand's step in that interval."""
    operator = Operator()
    operator.engage()
    sample = None
    last = HandSample(pose(operator.x), True, operator.count)
    seen_at = operator.now
    for what, grip, dt, conditions, aligned in ticks:
        operator.count += 1
        x = operator.x + {"move": 0.02, "leap": 0.8, "glitch": 0.5}.get(what, 0.0)
        operator.x = x if what in ("move", "leap") else operator.x
        T = np.full((4, 4), math.nan) if what == "nan" else pose(x)
        sample = HandSample(T, grip, operator.count, tracked=what != "untracked")
        sample = {"nothing": None, "repeat": last}.get(what, sample)
        before, state = operator.wrist.copy(), operator.arm.state
        step = operator.offer(sample, aligned=aligned, dt=dt, **conditions)
        interval = operator.now - seen_at
        if sample is not None and sample is not last:
            last, seen_at = sample, operator.now
        if step.target is not None:
            assert step.verdict is Verdict.OK
            assert not conditions.keys() & {"trouble", "revoked", "fault"}
            step_length = np.linalg.norm(step.target[:3, 3] - before[:3, 3])
            assert step_length <= (3.0 * max(interval, 0.02) if state is ArmState.ACTIVE else 0.0) + 1e-12
            assert turn(before[:3, :3], step.target[:3, :3]) <= 1e-7
