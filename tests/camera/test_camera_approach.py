"""The slow beginning: home first, then to the operator, then with the operator; never by itself, never fast."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from camera_client.approach import RISE, THERE, TOGETHER, Approach, HomeFirst, PacedLimiter, Stage
from ik_client.joint_limiter import MotionLimits
from ik_client.state_machine import ArmState

TICK = 0.02
SLOW = 0.2
N = 14
HOME, HAND = np.eye(4), np.eye(4)
HOME[:3, 3], HAND[:3, 3] = [0.2, 0.2, 0.1], [0.1, 0.3, 0.4]


class Arm:
    """A left arm and the ticks it is told of."""

    def __init__(self, *, home_first: bool = True) -> None:
        self.approach = Approach(0, SLOW, home_first=home_first)
        self.now = 10.0

    def tick(self, state: ArmState, gap: float = 0.0, authority: float = 1.0, success: bool = True) -> Stage:
        self.now += TICK
        q = np.zeros(N)
        answer = q.copy()
        answer[3], answer[10] = gap, 1.0  # what the other arm does is of no account
        arms = SimpleNamespace(state=state, authority=authority), SimpleNamespace(state=ArmState.ACTIVE, authority=1.0)
        reply = SimpleNamespace(success=success, sol_q=answer)
        report: Any = SimpleNamespace(time=self.now, arms=arms, reply=reply, command=SimpleNamespace(q=q))
        self.approach.observe(report)
        return self.approach.stage


def test_home_then_coming_then_following_at_a_pace_that_rises():
    arm = Arm()
    assert arm.tick(ArmState.DISARMED) is Stage.HOME
    assert arm.tick(ArmState.ACTIVE, 0.0, authority=0.9) is Stage.HOME  # the clutch still blends
    assert arm.tick(ArmState.ACTIVE, 1.01 * THERE) is Stage.HOME
    assert arm.tick(ArmState.ACTIVE, 0.99 * THERE) is Stage.COMING
    assert arm.tick(ArmState.ACTIVE, 1.01 * TOGETHER) is Stage.COMING
    assert arm.approach.pace == SLOW
    assert arm.tick(ArmState.ACTIVE, 0.99 * TOGETHER) is Stage.FOLLOWING
    assert arm.approach.pace == SLOW
    paces = []
    for _ in range(round(RISE / TICK)):
        assert arm.tick(ArmState.ACTIVE, 2.0) is Stage.FOLLOWING
        paces.append(arm.approach.pace)
    assert np.all(np.diff([SLOW, *paces]) <= TICK / RISE + 1e-12)
    assert paces[-1] == 1.0


def test_an_unusable_answer_brings_nobody_further():
    arm = Arm(home_first=False)
    assert arm.tick(ArmState.ACTIVE, 0.0, success=False) is Stage.COMING


@pytest.mark.parametrize("state", [ArmState.DISARMED, ArmState.ALIGNING, ArmState.FAULT])
def test_after_being_disarmed_it_is_slow_again_but_home_is_left_for_good(state):
    arm = Arm()
    for gap in (0.0, 0.0):
        arm.tick(ArmState.ACTIVE, gap)
    for _ in range(100):
        arm.tick(ArmState.ACTIVE)
    assert (arm.approach.stage, arm.approach.pace) == (Stage.FOLLOWING, 1.0)
    assert arm.tick(state) is Stage.COMING
    assert arm.approach.pace == SLOW


def test_let_go_on_the_way_home_and_it_goes_on_home_at_the_next_press():
    arm = Arm()
    assert arm.tick(ArmState.ACTIVE, 0.5) is Stage.HOME
    assert arm.tick(ArmState.HOLD) is Stage.HOME
    assert arm.tick(ArmState.DISARMED) is Stage.HOME
    assert arm.tick(ArmState.ACTIVE, 0.5) is Stage.HOME


def test_a_short_hold_changes_nothing():
    arm = Arm(home_first=False)
    for _ in range(30):
        arm.tick(ArmState.ACTIVE)
    pace = arm.approach.pace
    assert SLOW < pace < 1.0
    for _ in range(10):
        assert arm.tick(ArmState.HOLD) is Stage.FOLLOWING
    assert arm.approach.pace == pace


def test_the_clutch_goes_home_and_then_to_the_hand_from_where_the_wrist_is():
    arm = Arm()
    clutch, wrist = HomeFirst(arm.approach, HOME), np.eye(4)
    clutch.engage(HAND, wrist)
    assert np.allclose(clutch.follow(HAND, 0.0), wrist)
    assert np.allclose(clutch.follow(HAND, 0.5)[:3, 3], 0.5 * HOME[:3, 3])
    assert np.allclose(clutch.follow(HAND, 1.0), HOME)
    arm.tick(ArmState.ACTIVE)
    assert arm.approach.stage is Stage.COMING
    assert np.allclose(clutch.follow(HAND, 1.0), HAND)
    clutch.release()
    clutch.engage(HAND, HOME)
    assert np.allclose(clutch.follow(HAND, 0.0), HOME)


def test_no_joint_is_faster_than_its_arm_may_be():
    """The left arm comes, the right one follows: both are asked to go far, at once."""
    limits = MotionLimits(velocity=3.0)
    left, right = Arm(home_first=False), Arm(home_first=False)
    right.approach.pace = 1.0
    bounds = np.full(N, 3.0)
    limiter = PacedLimiter(N, TICK, limits, (left.approach, right.approach), lower=-bounds, upper=bounds)
    q, fastest = np.zeros(N), np.zeros(N)
    for _ in range(60):
        step = limiter.limit(q, np.full(N, 2.0))
        fastest, q = np.maximum(fastest, np.abs(step - q) / TICK), step
    assert fastest[:7] == pytest.approx(np.full(7, SLOW * 3.0), rel=1e-3)
    assert fastest[7:] == pytest.approx(np.full(7, 3.0), rel=1e-3)


def test_haste_that_is_asked_for_counts_where_it_is_less():
    arm = Arm(home_first=False)
    bounds = np.full(N, 3.0)
    limiter = PacedLimiter(
        N, TICK, MotionLimits(velocity=3.0), (arm.approach, arm.approach), lower=-bounds, upper=bounds
    )
    q = np.zeros(N)
    for _ in range(60):
        step = limiter.limit(q, np.full(N, 2.0), None, 0.1)
        assert np.abs(step - q).max() <= 0.1 * 3.0 * TICK * (1.0 + 1e-6)
        q = step
