"""The verb `velocity`: documents to requests and replies, and back."""

from typing import Any

import numpy as np

from ik_proto.errors import ReplyError
from ik_proto.fields import read_array, read_choice, read_id, read_number, read_two_words
from ik_proto.limits import (
    DEFAULT_ACCELERATION,
    DEFAULT_DAMPING,
    DEFAULT_PERIOD,
    DEFAULT_POSTURE_GAIN,
    DEFAULT_SPEED,
    MAX_ABS_JOINT,
    MAX_ABS_POSITION,
    MAX_TWIST,
)
from ik_proto.messages import COLLISIONS, FRAMES, LAWS, LIMITS, Array, Document, VelocityReply, VelocityRequest
from ik_proto.reply_head import read_head, read_pair

NUMBERS = {
    "damping": (DEFAULT_DAMPING, 1e-3, 1.0),
    "max_speed": (DEFAULT_SPEED, 1e-3, 100.0),
    "max_acceleration": (DEFAULT_ACCELERATION, 1e-2, 1e4),
    "period": (DEFAULT_PERIOD, 1e-4, 1.0),
    "posture_gain": (DEFAULT_POSTURE_GAIN, 0.0, 100.0),
}
"""Default, smallest and largest value of the numbers a request may carry."""

OPTIONS = frozenset(NUMBERS) | {
    "frame",
    "law",
    "hold_left",
    "hold_right",
    "posture",
    "left_bounds",
    "right_bounds",
    "waist",
    "collision",
}
"""Fields that a request may leave out."""

FIELDS = OPTIONS | {"left_twist", "right_twist", "q", "dq"}
"""Fields of a request beside those of all."""


def parse_velocity(document: Document, n: int, n_waist: int) -> VelocityRequest:
    """Validate a decoded `velocity`.

    Args:
        document: What a codec decoded.
        n: Number of arm joints of the robot served.
        n_waist: Number of its waist joints.

    Returns:
        A typed request.

    Raises:
        ValueError: A field is missing or wrong; one line that says which.
    """
    dq = document.get("dq")
    return VelocityRequest(
        left_twist=_read_twist(document, "left_twist"),
        right_twist=_read_twist(document, "right_twist"),
        q=read_array(document, "q", (n,), MAX_ABS_JOINT),
        dq=None if dq is None else read_array(document, "dq", (n,), MAX_ABS_JOINT),
        id=read_id(document),
        **(_read_options(document, n, n_waist) if not OPTIONS.isdisjoint(document) else {}),
    )


def velocity_fields(request: VelocityRequest) -> Document:
    """Put what is particular to a `velocity` into the form a codec encodes; defaults are left out."""
    document: Document = {
        "verb": "velocity",
        "left_twist": request.left_twist,
        "right_twist": request.right_twist,
        "q": request.q,
    }
    if request.dq is not None:
        document["dq"] = request.dq
    if request.frame != "pelvis":
        document["frame"] = request.frame
    if request.law != "adaptive":
        document["law"] = request.law
    if not request.hold_left:
        document["hold_left"] = False
    if not request.hold_right:
        document["hold_right"] = False
    for name, (default, _, _) in NUMBERS.items():
        if (value := getattr(request, name)) != default:
            document[name] = value
    for name in ("posture", "left_bounds", "right_bounds", "waist", "collision"):
        if (value := getattr(request, name)) is not None:
            document[name] = value
    return document


def velocity_reply_fields(reply: VelocityReply) -> Document:
    """Put what is particular to the answer to a `velocity` into the form a codec encodes."""
    document: Document = {
        "dq": reply.dq,
        "twists": reply.twists,
        "manipulability": reply.manipulability,
        "damping": reply.damping,
        "limited_by": reply.limited_by,
        "limiting_joint": reply.limiting_joint,
    }
    if reply.clearance is not None:
        document |= {"clearance": reply.clearance, "nearest": reply.nearest}
    return document | {"solve_us": reply.solve_us, "server_us": reply.server_us}


def parse_velocity_reply(document: Document, n: int) -> VelocityReply:
    """Validate the answer to a `velocity`; a refusal has the form of a solve reply.

    Args:
        document: What a codec decoded.
        n: Number of joints asked for.

    Returns:
        The reply.

    Raises:
        ReplyError: A required field is missing or wrong.
    """
    try:
        measured = document.get("clearance") is not None
        return VelocityReply(
            **read_head(document),
            dq=read_array(document, "dq", (n,)),
            twists=read_array(document, "twists", (2, 6)),
            manipulability=read_array(document, "manipulability", (2,)),
            damping=read_array(document, "damping", (2,)),
            limited_by=read_two_words(document, "limited_by", LIMITS),
            limiting_joint=read_two_words(document, "limiting_joint", None),
            clearance=read_number(document, "clearance") if measured else None,
            nearest=read_pair(document) if measured else None,
            solve_us=read_number(document, "solve_us"),
            server_us=read_number(document, "server_us"),
        )
    except ValueError as error:
        raise ReplyError(f"velocity reply: {error}") from None


def _read_twist(document: Document, name: str) -> Array:
    value = document.get(name)
    length = len(value) // 8 if isinstance(value, bytes) else np.size(value) if isinstance(value, np.ndarray) else None
    if length is None and isinstance(value, list | tuple):
        length = len(value)
    return read_array(document, name, (3,) if length == 3 else (6,), MAX_TWIST)


def _read_options(document: Document, n: int, n_waist: int) -> dict[str, Any]:
    read: dict[str, Any] = {
        "frame": read_choice(document, "frame", FRAMES, "pelvis"),
        "law": read_choice(document, "law", LAWS, "adaptive"),
        "hold_left": _read_flag(document, "hold_left"),
        "hold_right": _read_flag(document, "hold_right"),
        "collision": read_choice(document, "collision", COLLISIONS, None),
        "left_bounds": _read_bounds(document, "left_bounds"),
        "right_bounds": _read_bounds(document, "right_bounds"),
    }
    for name, shape in (("posture", (n,)), ("waist", (n_waist,))):
        read[name] = None if document.get(name) is None else read_array(document, name, shape, MAX_ABS_JOINT)
    for name, (default, low, high) in NUMBERS.items():
        value = default if document.get(name) is None else read_number(document, name)
        if not low <= value <= high:
            raise ValueError(f"{name} must be a number from {low:g} to {high:g}")
        read[name] = value
    return read


def _read_flag(document: Document, name: str) -> bool:
    value = document.get(name)
    if value is None:
        return True
    if not isinstance(value, bool):
        raise ValueError(f"{name} must be true or false")
    return value


def _read_bounds(document: Document, name: str) -> Array | None:
    if document.get(name) is None:
        return None
    bounds = read_array(document, name, (2, 3), MAX_ABS_POSITION)
    if not (bounds[0] <= bounds[1]).all():
        raise ValueError(f"{name} must have the smallest coordinates in its first row, the largest in its second")
    return bounds
