"""What a loop that drives the wrists by velocity asked for and was promised, for people to look at: `WristMotion`.

It rides on a command to the robot's own end, which may show it and never moves by it.
"""

from dataclasses import dataclass
from typing import cast

from ik_proto.fields import read_array, read_two_words
from ik_proto.limits import MAX_TWIST
from ik_proto.messages import LIMITS, Array, Document, LimitedBy

MAX_JOINT_NAME = 64
"""Longest name of a joint in a motion [characters]."""

_MOST_TWIST = 2**0.5 * MAX_TWIST
_MOST_MANIPULABILITY = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class WristMotion:
    """How the wrists were asked to move and what is said to come of it. Pairs are left, right.

    Attributes:
        twists: Asked of the wrists, in the pelvis frame, linear [m/s] and angular [rad/s], shape (2, 6).
        achieved: What the service says comes of it, likewise.
        manipulability: The service's measure of how far each arm is from a singular posture, shape (2,).
        limited_by: What slows each arm the most; empty for nothing.
        limiting_joint: The joint that it is, where it is one.
    """

    twists: Array
    achieved: Array
    manipulability: Array
    limited_by: tuple[LimitedBy, LimitedBy] = ("", "")
    limiting_joint: tuple[str | None, str | None] = (None, None)


def motion_document(motion: WristMotion) -> Document:
    """A motion as it travels."""
    return {name: getattr(motion, name) for name in WristMotion.__slots__}


def read_motion(value: object) -> WristMotion:
    """Read a motion.

    Args:
        value: What a codec decoded.

    Raises:
        ValueError: It is none; one line.
    """
    if not isinstance(value, dict):
        raise ValueError("motion must be an object")
    document = cast(Document, value)
    try:
        manipulability = read_array(document, "manipulability", (2,), _MOST_MANIPULABILITY)
        if (manipulability < 0.0).any():
            raise ValueError("manipulability must not be negative")
        return WristMotion(
            twists=read_array(document, "twists", (2, 6), _MOST_TWIST),
            achieved=read_array(document, "achieved", (2, 6), _MOST_TWIST),
            manipulability=manipulability,
            limited_by=read_two_words(document, "limited_by", LIMITS),
            limiting_joint=_two_joints(document),
        )
    except ValueError as error:
        raise ValueError(f"motion: {error}") from None


def _two_joints(document: Document) -> tuple[str | None, str | None]:
    names = read_two_words(document, "limiting_joint", None)
    if any(name is not None and len(name) > MAX_JOINT_NAME for name in names):
        raise ValueError(f"limiting_joint must have at most {MAX_JOINT_NAME} characters each")
    return names
