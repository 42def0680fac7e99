"""Poses on their way from an emulated headset, through the page and its socket, into the robot's axes."""

import math

import numpy as np
import pytest

from xr_client.frames import GripOffset, Side, hand_of_wrist, pose_of, quaternion_of, to_openxr, to_robot, wrist_of_hand
from xr_client.packets import Kind
from xr_client.tracker import Arrival

POSES = 40
INDEX_TIP = 9
MAX_DISTANCE, MAX_ANGLE = 1e-5, 1e-3
"""Of a wrist that arrives from where it was [m], and of its turn [degrees]. Hands tremble by a third of the first."""

PLACE = """
  const { head, left, right } = argument;
  xrDevice.position.set(...head.slice(0, 3));
  xrDevice.quaternion.set(...head.slice(3));
  xrOperator.place("left", left.slice(0, 3), left.slice(3));
  xrOperator.place("right", right.slice(0, 3), right.slice(3));
"""


def seven(T: np.ndarray) -> list[float]:
    return [*T[:3, 3].tolist(), *quaternion_of(T[:3, :3]).tolist()]


def distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Between two poses [degrees], exact for small ones."""
    return math.degrees(np.linalg.norm(a[:3, :3] - b[:3, :3]) / math.sqrt(2.0))


def wrists_in(rng: np.random.Generator) -> list[np.ndarray]:
    """A left and a right wrist anywhere before a person, turned anyhow, in the robot's axes."""
    return [pose_of(rng.uniform([0.1, -0.6, 0.8], [0.7, 0.6, 1.6]), rng.normal(size=4)) for _ in Side]


def head_in(rng: np.random.Generator) -> np.ndarray:
    """A head in the room, WebXR's axes."""
    return pose_of(rng.uniform([-0.2, 1.4, -0.2], [0.2, 1.8, 0.2]), np.array([*rng.normal(0.0, 0.3, 3), 1.0]))


def check(arrival: Arrival, head: np.ndarray, wrists: list[np.ndarray], kind: Kind) -> None:
    assert arrival.look.head is not None
    assert distance(arrival.look.head, to_robot(head)) < MAX_DISTANCE
    assert angle(arrival.look.head, to_robot(head)) < MAX_ANGLE
    for side in Side:
        sample = arrival.look.wrists[side]
        assert sample is not None
        assert sample.tracked
        assert arrival.packet.hands[side].kind is kind
        assert distance(sample.pose, wrists[side]) < MAX_DISTANCE
        assert angle(sample.pose, wrists[side]) < MAX_ANGLE


def joints(arrival: Arrival, side: Side) -> np.ndarray:
    found = arrival.packet.hands[side].joints
    assert found is not None
    return found


def place(worn, head: np.ndarray, hands: list[np.ndarray]) -> Arrival:
    server, tab = worn
    left, right = map(seven, hands)
    return server.after(tab, PLACE, {"head": seven(head), "left": left, "right": right})


def test_wrists_and_fingertips_of_tracked_hands(worn):
    worn[1].js("xrDevice.primaryInputMode = 'hand'; 0")
    first = place(worn, np.eye(4), [np.eye(4), np.eye(4)])
    # Hands at the origin show where a fingertip is from the wrist; wherever they go, that stays.
    tips = [joints(first, side)[INDEX_TIP] for side in Side]
    assert all(0.1 < np.linalg.norm(tip) < 0.25 for tip in tips)
    rng = np.random.default_rng(1)
    for _ in range(POSES):
        head, wrists = head_in(rng), wrists_in(rng)
        hands = [hand_of_wrist(wrists[side], side) for side in Side]
        arrival = place(worn, head, hands)
        check(arrival, head, wrists, Kind.HAND)
        for side in Side:
            tip = hands[side][:3, :3] @ tips[side] + hands[side][:3, 3]
            assert np.linalg.norm(joints(arrival, side)[INDEX_TIP] - tip) < MAX_DISTANCE


def test_wrists_behind_controllers(worn):
    worn[1].js("xrDevice.primaryInputMode = 'controller'; 0")
    T_wrist_grip = np.linalg.inv(GripOffset().transform())
    rng = np.random.default_rng(2)
    for _ in range(POSES):
        head, wrists = head_in(rng), wrists_in(rng)
        check(place(worn, head, [to_openxr(T @ T_wrist_grip) for T in wrists]), head, wrists, Kind.CONTROLLER)


def test_what_the_headset_is_told_directly_arrives_as_well(worn):
    """Without the operator of the emulator: the device's own pointing ray, and what IWER puts the wrist at."""
    server, tab = worn
    tab.js("xrDevice.primaryInputMode = 'hand'; 0")
    set_ray = "const [x, y, z, ...q] = argument; const h = xrDevice.hands.left; h.position.set(x, y, z);"
    set_ray += "h.quaternion.set(...q)"
    identity = server.after(tab, set_ray, [0, 0, 0, 0, 0, 0, 1]).packet.left.pose
    assert identity is not None
    T_ray_wrist = pose_of(identity[:3], identity[3:])
    rng = np.random.default_rng(3)
    for _ in range(5):
        T = hand_of_wrist(wrists_in(rng)[Side.LEFT], Side.LEFT)
        sample = server.after(tab, set_ray, seven(T @ np.linalg.inv(T_ray_wrist))).look.left
        assert sample is not None
        assert distance(sample.pose, wrist_of_hand(T, Side.LEFT)) < MAX_DISTANCE
        assert angle(sample.pose, wrist_of_hand(T, Side.LEFT)) < MAX_ANGLE


def test_triggers_squeezes_thumbsticks_and_buttons(worn):
    server, tab = worn
    tab.js("xrDevice.primaryInputMode = 'controller'; 0")
    script = """
      const { left, right } = xrDevice.controllers;
      right.updateButtonValue("trigger", 0.7); right.updateButtonValue("squeeze", 0.3);
      right.updateAxes("thumbstick", 0.25, -0.5); right.updateButtonValue("b-button", 1);
      left.updateButtonValue("x-button", 1); left.updateButtonValue("thumbstick", 1);
      left.updateAxes("thumbstick", -1, 1); left.updateButtonValue("trigger", 1)
    """
    left, right = server.after(tab, script).packet.hands
    assert (right.trigger, right.squeeze) == pytest.approx((0.7, 0.3), abs=1e-6)
    assert (right.stick, right.buttons) == ((0.25, -0.5), (False, True, False))
    assert (left.trigger, left.squeeze, left.stick, left.buttons) == (1.0, 0.0, (-1.0, 1.0), (True, False, True))
    script = """
      const { left, right } = xrDevice.controllers;
      for (const [side, buttons] of [[left, ["x-button"]], [right, ["b-button"]]]) {
        for (const id of ["trigger", "squeeze", "thumbstick", ...buttons]) { side.updateButtonValue(id, 0); }
        side.updateAxes("thumbstick", 0, 0);
      }
    """
    for hand in server.after(tab, script).packet.hands:
        assert (hand.trigger, hand.squeeze, hand.stick, hand.buttons) == (0.0, 0.0, (0.0, 0.0), (False,) * 3)
