"""What the loop did, as the HUD shows it."""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ik_client.engagement import ArmStep
from ik_client.gate import Verdict
from ik_client.state_machine import ArmState, Event
from ik_client.tick_report import LoopState, TickReport
from ik_client.types import Command, RobotState
from ik_proto import Status
from xr_client.hud_board import HudBoard
from xr_client.messages import hud_message
from xr_client.stages import Stages

Q = np.zeros(14)


def step(state: ArmState, reason: str = "") -> ArmStep:
    return ArmStep(state, Event.HELD, reason, Verdict.OK, 1.0)


def report(
    left=ArmState.ACTIVE, right=ArmState.DISARMED, *, errors=(0.001, 0.002), status=Status.OK, reason="", **others: Any
):
    reply: Any = SimpleNamespace(
        status=status,
        position_error=np.array(errors),
        rotation_error=np.array([0.01, 0.02]),
        solve_us=120.0,
    )
    fields: dict[str, Any] = {
        "measured": RobotState(Q, Q, 0.0),
        "reply": reply,
        "round_trip": 0.0005,
        "arms": (step(left), step(right, "not engaged: grip to engage")),
    }
    return TickReport(0.0, LoopState.TRACKING, reason, Command(Q, Q, 0.0), **(fields | others))


def test_before_the_first_tick():
    hud = HudBoard().hud()
    assert hud.left.state == "disarmed"
    assert hud.note


def test_state_reason_residual_latency():
    stages = Stages()
    stages["headset"].add(12.3456)
    stages["service"].add(0.5)
    board = HudBoard(stages)
    board.observe(report())
    hud = board.hud()
    assert (hud.left.state, hud.left.position_error_mm) == ("active", 1.0)
    assert hud.left.rotation_error_deg == pytest.approx(0.57)
    assert (hud.right.state, hud.right.reason) == ("disarmed", "not engaged: grip to engage")
    assert hud.right.position_error_mm is None
    assert hud.latency_ms == {
        "headset": 12.35,
        "wait": None,
        "service": 0.5,
        "command": None,
        "video": None,
        "solve": 0.12,
    }
    assert hud.note == ""
    assert json.loads(hud_message(hud))["type"] == "hud"


def test_every_change_of_state_is_counted():
    board = HudBoard()
    for state in (ArmState.ALIGNING, ArmState.ACTIVE, ArmState.ACTIVE, ArmState.HOLD):
        board.observe(report(left=state))
    assert (board.hud().left.changes, board.hud().right.changes) == (3, 0)


def test_a_person_is_warned_at_the_edge_of_the_workspace():
    board = HudBoard()
    board.observe(report(errors=(0.123, 0.5), status=Status.UNREACHABLE))
    hud = board.hud()
    assert hud.left.warning == "12 cm at the edge of what the arm reaches"
    assert hud.right.warning == ""


def test_numbers_that_are_none_are_not_shown():
    board = HudBoard()
    board.observe(report(errors=(np.nan, np.nan)))
    assert board.hud().left.position_error_mm is None
    board.observe(report(reply=None))
    assert board.hud().left.rotation_error_deg is None
    assert hud_message(board.hud())


def test_what_the_robot_says():
    board = HudBoard()
    board.observe(report(measured=RobotState(Q, Q, 0.0, ready=False, following=False, note="taking over")))
    assert board.hud().note == "robot: taking over"
    assert not board.robot_ready
    board.observe(report(measured=None, reason="RobotSilent: no state"))
    assert board.hud().note == "RobotSilent: no state"
    assert not board.robot_ready


def test_why_there_is_no_picture_comes_last():
    board = HudBoard()
    board.explain_pictures(lambda: "the robot sends no pictures")
    board.observe(report())
    assert board.hud().note == "the robot sends no pictures"
    board.observe(report(measured=None, reason="RobotSilent: no state"))
    assert board.hud().note == "RobotSilent: no state"
