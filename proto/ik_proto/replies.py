"""Replies to documents and back.

The first three keys are those of OpenWBT's `ik_server` (`sol_q`, `success`, `error_msg`), in its order; its clients
read two of them and ignore the rest. A client of ours checks what it gets as strictly as the service does.
"""

from typing import Any

from ik_proto.errors import ReplyError
from ik_proto.fields import read_array, read_integer, read_number, read_text
from ik_proto.limits import MAX_ID
from ik_proto.messages import BatchReply, ClearanceReply, Document, FkReply, InfoReply, Reply, SolveReply, VelocityReply
from ik_proto.reply_head import STATUSES, read_head, read_pair
from ik_proto.status import ANSWERS, Status, gravest
from ik_proto.velocities import velocity_reply_fields


def reply_document(reply: Reply) -> Document:
    """Put a reply into the form a codec encodes.

    Args:
        reply: Any reply.

    Returns:
        Its document, arrays still numpy arrays.
    """
    head: Document = {
        "sol_q": None,
        "success": reply.success,
        "error_msg": reply.error,
        "status": reply.status.value,
        "id": reply.id,
        "boot_id": reply.boot_id,
    }
    match reply:
        case SolveReply():
            head["sol_q"] = reply.sol_q
            if reply.success:
                head["tau"] = reply.tau
                head["position_error"] = reply.position_error
                head["rotation_error"] = reply.rotation_error
                if reply.clearance is not None:
                    head["clearance"] = reply.clearance
                    head["nearest"] = reply.nearest
                if reply.start is not None:
                    head["start"] = reply.start
                    head["starts"] = reply.starts
            head["iterations"] = reply.iterations
            head["solve_us"] = reply.solve_us
            head["server_us"] = reply.server_us
        case BatchReply():
            head["sol_q"] = reply.sol_q
            head |= {name: getattr(reply, name) for name in _BATCH_FIELDS}
        case FkReply():
            head["left_wrist"] = reply.left_wrist
            head["right_wrist"] = reply.right_wrist
        case ClearanceReply():
            head["clearance"] = reply.clearance
            head["nearest"] = reply.nearest
        case VelocityReply():
            head |= velocity_reply_fields(reply)
        case InfoReply():
            head |= {name: getattr(reply, name) for name in _INFO_FIELDS}
    return head


_NOTHING: dict[str, Any] = {}

_BATCH_FIELDS = (
    "statuses",
    "tau",
    "position_error",
    "rotation_error",
    "clearance",
    "start",
    "iterations",
    "solve_us",
    "server_us",
)

_INFO_FIELDS = (
    "protocol",
    "version",
    "robot",
    "model_hash",
    "joint_names",
    "lower",
    "upper",
    "velocity",
    "shoulders",
    "reach",
    "presets",
    "default_preset",
    "kernel",
    "waist_joints",
    "margin",
    "capsules",
    "modes",
)


def parse_solve_reply(document: Document, n: int) -> SolveReply:
    """Validate the reply to a solve, or the refusal of any request.

    Args:
        document: What a codec decoded.
        n: Number of joints asked for.

    Returns:
        The reply. Fields this client does not know are ignored, so that a newer service can answer it.

    Raises:
        ReplyError: A required field is missing or wrong.
    """
    try:
        head = read_head(document)
        success = head["success"]
        return SolveReply(
            **head,
            sol_q=read_array(document, "sol_q", (n,)) if success or document.get("sol_q") is not None else None,
            tau=read_array(document, "tau", (n,)) if success else None,
            position_error=read_array(document, "position_error", (2,)) if success else None,
            rotation_error=read_array(document, "rotation_error", (2,)) if success else None,
            iterations=read_integer(document, "iterations", 0, MAX_ID),
            solve_us=read_number(document, "solve_us"),
            server_us=read_number(document, "server_us"),
            **(_read_optional(document) if success else _NOTHING),
        )
    except ValueError as error:
        raise ReplyError(f"solve reply: {error}") from None


def parse_batch_reply(document: Document, rows: int, n: int) -> BatchReply:
    """Validate the reply to a `solve_batch` that was solved; a refusal has the form of a solve reply.

    Args:
        document: What a codec decoded.
        rows: Number of problems asked for.
        n: Number of joints of each.

    Returns:
        The reply.

    Raises:
        ReplyError: A required field is missing or wrong.
    """
    try:
        head = read_head(document)
        statuses = _read_statuses(document, rows)
        if head["status"] is not gravest(statuses):
            raise ValueError(f"status {head['status']} is not the gravest of its rows")
        return BatchReply(
            **head,
            sol_q=read_array(document, "sol_q", (rows, n)),
            statuses=statuses,
            tau=read_array(document, "tau", (rows, n)),
            position_error=read_array(document, "position_error", (rows, 2)),
            rotation_error=read_array(document, "rotation_error", (rows, 2)),
            clearance=None if document.get("clearance") is None else read_array(document, "clearance", (rows,)),
            start=_read_starts(document, rows),
            iterations=read_integer(document, "iterations", 0, MAX_ID),
            solve_us=read_number(document, "solve_us"),
            server_us=read_number(document, "server_us"),
        )
    except ValueError as error:
        raise ReplyError(f"batch reply: {error}") from None


def parse_fk_reply(document: Document) -> FkReply:
    """Validate the reply to an fk.

    Raises:
        ReplyError: A required field is missing or wrong.
    """
    try:
        return FkReply(
            **read_head(document),
            left_wrist=read_array(document, "left_wrist", (4, 4)),
            right_wrist=read_array(document, "right_wrist", (4, 4)),
        )
    except ValueError as error:
        raise ReplyError(f"fk reply: {error}") from None


def parse_clearance_reply(document: Document, rows: int) -> ClearanceReply:
    """Validate the reply to a clearance.

    Args:
        document: What a codec decoded.
        rows: Number of postures asked for.

    Returns:
        The reply.

    Raises:
        ReplyError: A required field is missing or wrong.
    """
    try:
        measured = document.get("clearance") is not None
        return ClearanceReply(
            **read_head(document),
            clearance=read_array(document, "clearance", (rows,)) if measured else None,
            nearest=read_pair(document) if measured else None,
        )
    except ValueError as error:
        raise ReplyError(f"clearance reply: {error}") from None


def parse_info_reply(document: Document) -> InfoReply:
    """Validate the reply to an info.

    Raises:
        ReplyError: A required field is missing or wrong.
    """
    try:
        joint_names = _read_names(document, "joint_names")
        n = len(joint_names)
        return InfoReply(
            **read_head(document),
            protocol=read_integer(document, "protocol", 0, MAX_ID),
            version=read_text(document, "version"),
            robot=read_text(document, "robot"),
            model_hash=read_text(document, "model_hash"),
            joint_names=joint_names,
            lower=read_array(document, "lower", (n,)),
            upper=read_array(document, "upper", (n,)),
            velocity=read_array(document, "velocity", (n,)),
            shoulders=read_array(document, "shoulders", (2, 3)),
            reach=read_array(document, "reach", (2,)),
            presets=_read_names(document, "presets"),
            default_preset=read_text(document, "default_preset"),
            kernel=read_text(document, "kernel"),
            waist_joints=_read_names(document, "waist_joints"),
            margin=read_number(document, "margin"),
            capsules=_read_names(document, "capsules"),
            modes=_read_names(document, "modes"),
        )
    except ValueError as error:
        raise ReplyError(f"info reply: {error}") from None


def _read_optional(document: Document) -> dict[str, Any]:
    """What the answer to a solve says where it was looked at."""
    read: dict[str, Any] = {}
    if document.get("clearance") is not None:
        read["clearance"] = read_number(document, "clearance")
        read["nearest"] = read_pair(document)
    if document.get("start") is not None:
        read["start"] = read_integer(document, "start", 0, MAX_ID)
        read["starts"] = read_integer(document, "starts", 0, MAX_ID)
    return read


def _read_statuses(document: Document, rows: int) -> list[Status]:
    words = document.get("statuses")
    if not isinstance(words, list) or len(words) != rows:
        raise ValueError(f"statuses must be a list of {rows} words")
    if not all(word in ANSWERS for word in words):
        raise ValueError(f"statuses must be {', '.join(ANSWERS)}")
    return [STATUSES[word] for word in words]


def _read_starts(document: Document, rows: int) -> list[int]:
    starts = document.get("start")
    if not isinstance(starts, list) or len(starts) != rows:
        raise ValueError(f"start must be a list of {rows} integers")
    if not all(type(start) is int and 0 <= start <= MAX_ID for start in starts):
        raise ValueError("start must hold integers from 0 to 2^53 - 1")
    return starts


def _read_names(document: Document, name: str) -> list[str]:
    value = document.get(name)
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise ValueError(f"{name} must be a list of strings")
    return value
