"""The thin client: one class to call the IK service, and the teleop loop around it.

Importing it loads numpy, msgpack and orjson; Zenoh when a `zenoh://` address is used, and nothing heavier ever.
"""

from ik_client.absolute_clutch import ABSOLUTE_FALL, AbsoluteClutch
from ik_client.authority import Authority
from ik_client.client import IKClient
from ik_client.clutch import Clutch
from ik_client.engagement import ArmEngagement, ArmStep
from ik_client.errors import (
    BadRequest,
    IKError,
    ProtocolMismatch,
    Refused,
    ServiceTimeout,
    ServiceUnavailable,
    Unauthorized,
)
from ik_client.gate import Gated, GateLimits, PoseGate
from ik_client.hand import HandSample
from ik_client.limiter import StepLimiter
from ik_client.state_machine import ArmState, StateMachine
from ik_client.teleop import TeleopLoop
from ik_client.tick_report import LoopState, Seed, TickReport
from ik_client.types import Command, Hands, HandSource, Kinematics, Limiter, RobotPort, RobotState, Solver
from ik_proto.smoothing import WeightedMovingFilter
from ik_proto.wrist_motion import WristMotion

__all__ = [
    "ABSOLUTE_FALL",
    "AbsoluteClutch",
    "ArmEngagement",
    "ArmState",
    "ArmStep",
    "Authority",
    "BadRequest",
    "Clutch",
    "Command",
    "GateLimits",
    "Gated",
    "HandSample",
    "HandSource",
    "Hands",
    "IKClient",
    "IKError",
    "Kinematics",
    "Limiter",
    "LoopState",
    "PoseGate",
    "ProtocolMismatch",
    "Refused",
    "RobotPort",
    "RobotState",
    "Seed",
    "ServiceTimeout",
    "ServiceUnavailable",
    "Solver",
    "StateMachine",
    "StepLimiter",
    "TeleopLoop",
    "TickReport",
    "Unauthorized",
    "WeightedMovingFilter",
    "WristMotion",
]
