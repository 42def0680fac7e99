"""Robot descriptions: the model file, and what both ends must agree on beyond it."""

from ik_proto.robots.description import (
    ArmDescription,
    JointDescription,
    RobotDescription,
    RobotError,
    WristFrame,
    load_description,
)

__all__ = [
    "ArmDescription",
    "JointDescription",
    "RobotDescription",
    "RobotError",
    "WristFrame",
    "load_description",
]
