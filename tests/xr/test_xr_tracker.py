"""Packets in, hands out: latest wins, arrival counts, and what was gripped elsewhere must be gripped anew."""

import threading
from typing import Any

import numpy as np
import pytest
from xr_samples import LEVEL, at, controller, hand, packet

from ik_client.engagement import ArmEngagement
from ik_client.gate import PoseGate, Verdict
from ik_client.state_machine import ArmState
from xr_client.frames import GripOffset, Side, pose_of, wrist_of_grip, wrist_of_hand
from xr_client.packets import HandPacket, Kind
from xr_client.reference import HeadReference
from xr_client.tracker import Tracker

PERIOD = 0.011


class Operator:
    """Feeds a tracker with packets of a left controller and ticks an arm after each, as the loop would."""

    def __init__(self, tracker: Tracker | None = None) -> None:
        self.tracker = tracker or Tracker()
        self.tracker.connect()
        self.arm = ArmEngagement()
        self.now = 100.0
        self.seq = 0
        self.x = 0.0

    def step(self, squeeze: float, count: int = 1, *, gap: float = 0.0, jump: float = 0.0, **others: Any) -> ArmState:
        """Some packets in a row, the hand moving on by a little in each."""
        self.x += jump
        for _ in range(count):
            self.now += gap or PERIOD
            self.seq += 1
            self.x += 1e-3
            left = others.get("left") or controller(at(self.x), squeeze)
            assert self.tracker.feed(packet(self.seq, **others | {"left": left}), self.now)
            state = self.tick()
        return state

    def tick(self) -> ArmState:
        hands = self.tracker.hands(self.now)
        sample = hands.left if hands else None
        return self.arm.step(sample, self.now, wrist=lambda: np.eye(4), aligned=True).state

    def engage(self) -> None:
        self.step(0.0, 3)
        assert self.step(1.0, 3) is ArmState.ACTIVE


def test_a_squeeze_engages():
    Operator().engage()


def test_a_squeeze_held_at_connection_engages_nothing():
    operator = Operator()
    assert operator.step(1.0, 50) is ArmState.DISARMED
    operator.engage()


def test_the_poses_are_those_of_the_packet():
    offset = GripOffset(0.3, 0.1)
    tracker = Tracker(HeadReference(), offset)
    tracker.connect()
    grip, wrist = at(-0.2, 1.1, -0.4), at(0.2, 1.1, -0.4)
    tracker.feed(packet(1, left=controller(grip), right=hand(wrist)), 1.0)
    hands = tracker.hands(1.0)
    assert hands is not None
    assert hands.left is not None
    assert hands.right is not None
    shift = np.array([0.15, 0.0, 0.45 - 1.6])
    for sample, T in (
        (hands.left, wrist_of_grip(pose_of(grip[:3], grip[3:]), offset)),
        (hands.right, wrist_of_hand(pose_of(wrist[:3], wrist[3:]), Side.RIGHT)),
    ):
        np.testing.assert_allclose(sample.pose[:3, 3], T[:3, 3] + shift, atol=1e-12)
        np.testing.assert_allclose(sample.pose[:3, :3], T[:3, :3], atol=1e-12)


def test_there_are_no_hands_without_a_connection():
    tracker = Tracker()
    assert tracker.hands(0.0) is None
    tracker.connect()
    assert tracker.hands(0.0) is None
    tracker.feed(packet(1, left=controller(at())), 0.0)
    assert tracker.hands(0.0) is not None
    tracker.disconnect()
    assert tracker.hands(0.0) is None


def test_old_packets_change_nothing():
    tracker = Tracker()
    tracker.connect()
    assert tracker.feed(packet(5, epoch=2), 1.0)
    latest = tracker.latest
    for old in (packet(5, epoch=2), packet(4, epoch=3), packet(9, epoch=1)):
        assert not tracker.feed(old, 2.0)
        assert tracker.latest is latest
    assert tracker.order.dropped == 3
    tracker.connect()
    assert tracker.feed(packet(0, epoch=0), 3.0)


def test_age_is_counted_from_arrival_whatever_the_page_says():
    """A page's clock of the future, or of the past, keeps nothing fresh."""
    for capture_ms in (-1e12, 1e15):
        operator = Operator()
        operator.step(0.0, 3, capture_ms=capture_ms)
        assert operator.step(1.0, 3, capture_ms=capture_ms) is ArmState.ACTIVE
        operator.now += 0.11
        assert operator.tick() is ArmState.HOLD
        operator.now += 0.6
        assert operator.tick() is ArmState.DISARMED


DISTURBANCES: dict[str, dict[str, Any]] = {
    "recentred": {"epoch": 2, "jump": 0.5},
    "menu": {"visible": False},
    "hand instead of controller": {"left": hand(at(), 0.0)},
}


@pytest.mark.parametrize("name", DISTURBANCES)
def test_after_a_change_of_room_a_grip_counts_no_longer(name):
    """The squeeze stays closed all along; the arm holds at once and engages again only with a new squeeze."""
    operator = Operator()
    operator.engage()
    disturbed = dict(DISTURBANCES[name])
    assert operator.step(1.0, 1, **disturbed) is ArmState.HOLD
    disturbed.pop("jump", None)
    assert operator.step(1.0, 100, **disturbed) is ArmState.DISARMED
    calm = {"epoch": 2}
    assert operator.step(1.0, 50, **calm) is ArmState.DISARMED
    operator.step(0.0, 3, **calm)
    assert operator.step(1.0, 3, **calm) is ArmState.ACTIVE


def test_after_a_reconnection_a_grip_counts_no_longer():
    operator = Operator()
    operator.engage()
    operator.tracker.disconnect()
    assert operator.tick() is ArmState.HOLD
    operator.tracker.connect()
    assert operator.step(1.0, 100) is ArmState.DISARMED
    operator.engage()


def test_a_hand_out_of_sight_for_a_moment_goes_on():
    operator = Operator()
    operator.engage()
    lost = HandPacket(Kind.CONTROLLER, None, squeeze=1.0)
    assert operator.step(1.0, 10, left=lost) is ArmState.HOLD
    assert operator.step(1.0, 3) is ArmState.ACTIVE
    assert operator.step(1.0, 10, left=HandPacket()) is ArmState.HOLD
    assert operator.step(1.0, 3) is ArmState.ACTIVE


def test_a_hand_out_of_sight_for_long_must_grip_anew():
    operator = Operator()
    operator.engage()
    lost = HandPacket(Kind.CONTROLLER, None, squeeze=1.0)
    assert operator.step(1.0, 60, left=lost) is ArmState.DISARMED
    assert operator.step(1.0, 30) is ArmState.DISARMED
    operator.engage()


def test_a_room_that_is_a_guess_has_no_hands():
    operator = Operator()
    operator.engage()
    assert operator.step(1.0, 2, head_guessed=True) is ArmState.HOLD


@pytest.mark.parametrize("reference", [HeadReference(), None])
def test_a_frozen_hand_is_lost_though_the_head_moves(reference):
    """In a frame that comes along with the head a frozen hand moves; the gate alone would follow it."""
    tracker, gate = Tracker(reference), PoseGate()
    tracker.connect()
    verdicts = []
    for k in range(100):
        now = 0.01 * k
        head = LEVEL + 1e-3 * k * np.array([1.0, 0, 0, 0, 0, 0, 0])
        tracker.feed(packet(k, head=head, left=controller(at())), now)
        hands = tracker.hands(now)
        assert hands is not None
        verdicts.append(gate.check(hands.left, now).verdict)
    assert verdicts[1:50] == [Verdict.OK] * 49
    assert set(verdicts[52:]) <= {Verdict.UNTRACKED, Verdict.GONE}


def test_two_threads_see_whole_packets():
    """Poses of one packet belong together: left and right mirror each other in all that the loop ever sees."""
    tracker = Tracker(HeadReference())
    tracker.connect()
    done = threading.Event()

    def feed():
        for k in range(3000):
            x = 1e-4 * (k + 1)
            tracker.feed(packet(k, left=controller(at(-x)), right=controller(at(x))), 0.0)
        done.set()

    feeder = threading.Thread(target=feed)
    feeder.start()
    seen = set()
    while not done.is_set():
        hands = tracker.hands(0.0)
        if hands and hands.left and hands.right:
            assert hands.left.pose[1, 3] == -hands.right.pose[1, 3]
            seen.add(float(hands.left.pose[1, 3]))
    feeder.join()
    assert len(seen) > 1
