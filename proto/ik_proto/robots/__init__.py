"""Robot descriptions: the model file, and what both ends must agree on beyond it."""

from ik_proto.robots.description import (
    ArmDescription,
    CapsuleDescription,
    CollisionDescription,
    IgnoredPair,
    JointDescription,
    RobotDescription,
    RobotError,
    WristFrame,
    load_description,
)

__all__ = [
    "ArmDescription",
    "CapsuleDescription",
    "CollisionDescription",
    "IgnoredPair",
    "JointDescription",
    "RobotDescription",
    "RobotError",
    "WristFrame",
    "load_description",
]
