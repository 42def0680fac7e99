"""What the operator sees: the same status in the window and in the terminal."""

from typing import Any

import numpy as np
import pytest
from rich.console import Console

pytest.importorskip("pygame")

from gamepad_client.displays import Display
from gamepad_client.layout import Layout
from gamepad_client.operator import Operator
from gamepad_client.picture import SIZE, Picture
from gamepad_client.status import Hand, Status, status_of
from gamepad_client.table import render
from ik_client import ArmState, Command
from ik_client.devices import Devices
from ik_client.rate_types import RateReport, Wish
from ik_proto import Status as Answer
from ik_proto import VelocityReply

FORWARD = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])


def status(**changes) -> Status:
    fast = Hand(FORWARD, FORWARD, 0.7, False, "")
    slow = Hand(FORWARD, 0.5 * FORWARD, 0.1, True, "joint: right_elbow_joint")
    fields: dict[str, Any] = {
        "device": "a pad",
        "state": ArmState.ACTIVE,
        "reason": "",
        "hands": (fast, slow),
        "frame": "pelvis",
        "speed": 0.3,
        "homing": False,
        "hint": "hold left shoulder and move",
    }
    return Status(**(fields | changes))


def printed(shown: Status) -> str:
    console = Console(width=140)
    with console.capture() as captured:
        console.print(render(shown))
    return captured.get()


def test_the_table_says_all_of_it():
    text = printed(status())
    for words in ("active", "+0.30 +0.00 +0.00", "+0.15", "joint: right_elbow_joint", "pelvis", "0.30 m/s", "[m/s]"):
        assert words in text
    assert "the pad is gone" in printed(status(state=ArmState.DISARMED, reason="the pad is gone"))
    assert "hold left shoulder" in printed(status(state=ArmState.DISARMED))


def test_the_picture_changes_with_what_it_shows():
    picture = Picture()
    seen = picture.draw(status())
    assert (seen.shape, seen.dtype) == ((SIZE[1], SIZE[0], 3), np.uint8)
    np.testing.assert_array_equal(picture.draw(status()), seen)
    left, right = status().hands
    still = Hand(np.zeros(6), np.zeros(6), 0.7, False, "")
    for changed in (
        status(hands=(still, right)),
        status(hands=(left, still)),
        status(state=ArmState.HOLD),
        status(reason="something"),
        status(speed=0.6),
        status(frame="hand"),
        status(hands=(Hand(FORWARD, None, None, False, ""), right)),
    ):
        assert (picture.draw(changed) != seen).any()


def test_forward_is_up_and_left_is_left_in_the_picture():
    picture = Picture()
    none = Hand(np.zeros(6), None, None, False, "")
    rest = picture.draw(status(hands=(none, none))).astype(int)
    for twist, across, along in ((FORWARD, 0, -1), (np.roll(FORWARD, 1), -1, 0)):
        drawn = picture.draw(status(hands=(Hand(twist, None, None, False, ""), none))).astype(int)
        rows, columns = np.nonzero(np.abs(drawn - rest).max(axis=2))
        middle = np.array([columns.mean(), rows.mean()]) - (130, 184)
        assert np.sign(np.round(middle / 20)).tolist() == [across, along]


def report(**changes) -> RateReport:
    reply = VelocityReply(
        success=True,
        error="",
        status=Answer.OK,
        boot_id="a",
        dq=np.zeros(14),
        twists=np.array([FORWARD, 0.5 * FORWARD]),
        manipulability=np.array([0.02, 0.001]),
        damping=np.array([0.0, 0.02]),
        limited_by=("", "joint"),
        limiting_joint=(None, "right_elbow_joint"),
    )
    command = Command(np.zeros(14), np.zeros(14), 0.0)
    fields: dict[str, Any] = {
        "time": 0.0,
        "state": ArmState.ACTIVE,
        "moving": True,
        "reason": "",
        "command": command,
        "sent": 0.0,
        "wish": Wish(np.array([FORWARD, FORWARD]), True, 0.0),
        "reply": reply,
    }
    return RateReport(**(fields | changes))


def test_a_status_is_what_a_tick_did():
    with Devices() as devices:
        operator = Operator(devices, Layout())
        shown = status_of(report(), operator, Layout(), keyboard=False)
        assert shown.device == "no pad: plug one in"
        assert shown.hint == "hold left shoulder and move"
        assert [hand.limit for hand in shown.hands] == ["", "joint: right_elbow_joint"]
        assert [hand.damped for hand in shown.hands] == [False, True]
        assert [hand.manipulability for hand in shown.hands] == pytest.approx([1.0, 0.1])
        blocked = status_of(report(homing=True, blocked=True), operator, Layout(), keyboard=False)
        assert "not clear of the body" in blocked.reason
        there = status_of(report(homing=True, at_home=True), operator, Layout(), keyboard=False)
        assert there.reason == "at home"
        silent = status_of(report(wish=None, reply=None, moving=False), operator, Layout(), keyboard=True)
        assert silent.hands[0].achieved is None
        assert silent.hint == "hold space and move"


def test_a_display_shows_as_often_as_is_of_use(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    asked = []

    def look() -> Status:
        asked.append(True)
        return status()

    with Devices(SIZE) as devices:
        display = Display(devices, lambda _line: None, terminal=True)
        for tick in range(200):
            display.show(look, 0.005 * tick)
        display.close()
    assert 15 <= len(asked) <= 21


def test_without_window_and_terminal_nothing_is_drawn():
    with Devices() as devices:
        display = Display(devices, lambda _line: None, terminal=False)
        display.show(lambda: pytest.fail("nobody sees it"), 0.0)
        display.close()
