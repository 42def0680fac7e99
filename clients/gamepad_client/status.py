"""What an operator wants to see, the same for window and terminal."""

from dataclasses import dataclass

import numpy as np

from gamepad_client.layout import KEY_HOLD, PAD_HOLD, Layout
from gamepad_client.operator import Operator
from ik_client.rate_types import RateReport
from ik_client.state_machine import ArmState
from ik_proto import Array

GOOD = 0.01
"""Manipulability at which its bar is full [m^3]: that of a G1's arm with the elbow at a right angle."""


@dataclass(frozen=True, slots=True, eq=False)
class Hand:
    """What one hand does.

    Attributes:
        asked: Its wanted velocity, linear [m/s] and angular [rad/s], shape (6,).
        achieved: What the service says comes of it, shape (6,); None where it was not asked.
        manipulability: How far the arm is from a singular posture, 0 to 1; None where it is not known.
        damped: Whether it is so near that the answer is damped.
        limit: What slows it the most, in words; empty for nothing.
    """

    asked: Array
    achieved: Array | None
    manipulability: float | None
    damped: bool
    limit: str


@dataclass(frozen=True, slots=True)
class Status:
    """A tick for people.

    Attributes:
        device: What moves the hands.
        state: The state of the arms.
        reason: Why they do not move; empty where they do.
        hands: Left and right.
        frame: Along whose axes they are moved.
        speed: With the stick at its edge [m/s].
        homing: Whether they go home.
        hint: How to make them move.
    """

    device: str
    state: ArmState
    reason: str
    hands: tuple[Hand, Hand]
    frame: str
    speed: float
    homing: bool
    hint: str


def status_of(report: RateReport, operator: Operator, layout: Layout, *, keyboard: bool) -> Status:
    """Pick from a tick what is shown."""
    device = "keyboard" if keyboard else operator.pad.name if operator.pad else "no pad: plug one in"
    hold = layout.hold or (KEY_HOLD if keyboard else PAD_HOLD)
    return Status(
        device=device,
        state=report.state,
        reason=_reason(report),
        hands=(_hand(report, 0), _hand(report, 1)),
        frame=operator.frame,
        speed=operator.speed,
        homing=report.homing,
        hint=f"hold {hold.partition(':')[2].replace('_', ' ')} and move",
    )


def _reason(report: RateReport) -> str:
    if report.blocked:
        return "the way home is not clear of the body: lead the hands around it with the sticks"
    return "at home" if report.homing and report.at_home else report.reason


def _hand(report: RateReport, side: int) -> Hand:
    asked = report.wish.twists[side] if report.wish else np.zeros(6)
    reply = report.reply
    if reply is None:
        return Hand(asked, None, None, False, "")
    joint = reply.limiting_joint[side]
    limit = f"{reply.limited_by[side]}{f': {joint}' if joint else ''}"
    good = min(1.0, float(reply.manipulability[side]) / GOOD)
    return Hand(asked, reply.twists[side] if report.moving else None, good, bool(reply.damping[side] > 0.0), limit)
