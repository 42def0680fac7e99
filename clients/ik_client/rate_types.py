"""What passes through the rate loop: an operator's wish in, the law to follow it by, and what a tick did."""

from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np

from ik_client.state_machine import ArmState
from ik_client.tick import is_finite
from ik_client.types import Command, Kinematics, RobotState
from ik_proto import Array, Collision, Frame, Law, VelocityReply
from ik_proto.limits import DEFAULT_ACCELERATION, DEFAULT_DAMPING, DEFAULT_POSTURE_GAIN, DEFAULT_SPEED
from ik_proto.wrist_motion import WristMotion

MAX_AGE = 0.1
"""Age at which a wish is no longer the operator's [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Wish:
    """What an operator wants in a tick.

    Attributes:
        twists: Velocities of the left and of the right wrist, linear [m/s] and angular [rad/s], shape (2, 6).
        held: Whether the hold-to-run switch is held; None where it is not there.
        time: When the operator was looked at, by the loop's clock [s].
        frame: Along whose axes the twists are given.
        home: Whether the arms shall go home instead.
        stop: Whether the arms shall be disarmed.
    """

    twists: Array
    held: bool | None
    time: float
    frame: Frame = "pelvis"
    home: bool = False
    stop: bool = False


class WishSource(Protocol):
    """Sticks, keys, a script."""

    def wish(self, now: float) -> Wish | None:
        """Say what the operator wants.

        Args:
            now: Time of the tick [s].

        Returns:
            The latest look, or None where there is none.
        """
        ...


class RateKinematics(Kinematics, Protocol):
    """What the loop needs of an `IKClient`."""

    def velocity(
        self,
        left_twist: Array,
        right_twist: Array,
        q: Array,
        dq: Array | None = None,
        *,
        frame: Frame = "pelvis",
        law: Law = "adaptive",
        hold: tuple[bool, bool] = (True, True),
        damping: float = DEFAULT_DAMPING,
        max_speed: float = DEFAULT_SPEED,
        max_acceleration: float = DEFAULT_ACCELERATION,
        period: float = ...,
        posture: Array | None = None,
        posture_gain: float = DEFAULT_POSTURE_GAIN,
        left_bounds: Array | None = None,
        right_bounds: Array | None = None,
        waist: Array | None = None,
        collision: Collision | None = None,
    ) -> VelocityReply:
        """Find joint velocities for two twists; see `IKClient.velocity`."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class RateLaw:
    """How twists become joint velocities; the fields are those of `IKClient.velocity`."""

    law: Law = "adaptive"
    hold: tuple[bool, bool] = (True, True)
    damping: float = DEFAULT_DAMPING
    max_speed: float = DEFAULT_SPEED
    max_acceleration: float = DEFAULT_ACCELERATION
    posture: Array | None = None
    posture_gain: float = DEFAULT_POSTURE_GAIN
    left_bounds: Array | None = None
    right_bounds: Array | None = None
    collision: Collision | None = None

    @property
    def options(self) -> dict[str, Any]:
        """Keywords for `IKClient.velocity`."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}


@dataclass(frozen=True, slots=True, eq=False)
class RateReport:
    """What one tick did.

    Attributes:
        time: When it began [s].
        state: State of both arms.
        moving: Whether the arms followed: a twist, or the way home.
        reason: Why they did not, in words that stay the same while the cause does; empty while they did.
        command: What was sent to the robot.
        sent: When it was on its way [s].
        wish: What the operator wanted; None where that is not known.
        homing: Whether they were on their way home.
        at_home: Whether they are there.
        blocked: Whether they are on their way home, not there, and do not move: the straight way is not clear.
        measured: What the robot measured; None where it could not be read.
        reply: The service's answer to the twists; None where there was none.
        round_trip: How long that took, successful or not [s]; None where nothing was asked.
        fault: The exception that made them hold, if it was one.
    """

    time: float
    state: ArmState
    moving: bool
    reason: str
    command: Command
    sent: float
    wish: Wish | None = None
    homing: bool = False
    at_home: bool = False
    blocked: bool = False
    measured: RobotState | None = None
    reply: VelocityReply | None = None
    round_trip: float | None = None
    fault: Exception | None = None


def shown_motion(
    wish: Wish | None, reply: VelocityReply | None, wrists: tuple[Array, Array] | None
) -> WristMotion | None:
    """What to show of a tick, in the pelvis frame.

    Args:
        wish: What the operator wanted.
        reply: The service's answer.
        wrists: `T_pelvis_wrist`, left and right; None where that is not known.

    Returns:
        The motion; None where it is not known.
    """
    if wish is None or reply is None or not all(is_finite(row, 6) for row in reply.twists):
        return None
    asked, achieved = wish.twists, reply.twists
    if wish.frame == "hand":
        if wrists is None:
            return None
        asked, achieved = (_turned(wrists, twists) for twists in (asked, achieved))
    return WristMotion(asked, achieved, reply.manipulability, reply.limited_by, reply.limiting_joint)


def _turned(wrists: tuple[Array, Array], twists: Array) -> Array:
    """Twists along the hands' axes, in the pelvis frame, shape (2, 6)."""
    rows = [np.concatenate([T[:3, :3] @ row[:3], T[:3, :3] @ row[3:]]) for T, row in zip(wrists, twists, strict=True)]
    return np.array(rows)
