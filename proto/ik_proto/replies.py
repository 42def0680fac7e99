"""Replies to documents and back.

The first three keys are those of OpenWBT's `ik_server` (`sol_q`, `success`, `error_msg`), in its order; its clients
read two of them and ignore the rest. A client of ours checks what it gets as strictly as the service does.
"""

from typing import Any

from ik_proto.errors import ReplyError
from ik_proto.fields import read_array, read_id, read_number, read_text
from ik_proto.messages import Document, FkReply, InfoReply, Reply, SolveReply
from ik_proto.status import Status


def reply_document(reply: Reply) -> Document:
    """Put a reply into the form a codec encodes.

    Args:
        reply: Any reply.

    Returns:
        Its document, arrays still numpy arrays.
    """
    head = {
        "sol_q": reply.sol_q if isinstance(reply, SolveReply) else None,
        "success": reply.success,
        "error_msg": reply.error,
        "status": reply.status.value,
        "id": reply.id,
        "boot_id": reply.boot_id,
    }
    match reply:
        case SolveReply():
            if reply.success:
                head["tau"] = reply.tau
                head["position_error"] = reply.position_error
                head["rotation_error"] = reply.rotation_error
            head["iterations"] = reply.iterations
            head["solve_us"] = reply.solve_us
            head["server_us"] = reply.server_us
        case FkReply():
            head["left_wrist"] = reply.left_wrist
            head["right_wrist"] = reply.right_wrist
        case InfoReply():
            head |= {name: getattr(reply, name) for name in _INFO_FIELDS}
    return head


_STATUSES = {status.value: status for status in Status}

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
        head = _head(document)
        success = head["success"]
        return SolveReply(
            **head,
            sol_q=read_array(document, "sol_q", (n,)) if success or document.get("sol_q") is not None else None,
            tau=read_array(document, "tau", (n,)) if success else None,
            position_error=read_array(document, "position_error", (2,)) if success else None,
            rotation_error=read_array(document, "rotation_error", (2,)) if success else None,
            iterations=int(read_number(document, "iterations")),
            solve_us=read_number(document, "solve_us"),
            server_us=read_number(document, "server_us"),
        )
    except ValueError as error:
        raise ReplyError(f"solve reply: {error}") from None


def parse_fk_reply(document: Document) -> FkReply:
    """Validate the reply to an fk.

    Raises:
        ReplyError: A required field is missing or wrong.
    """
    try:
        return FkReply(
            **_head(document),
            left_wrist=read_array(document, "left_wrist", (4, 4)),
            right_wrist=read_array(document, "right_wrist", (4, 4)),
        )
    except ValueError as error:
        raise ReplyError(f"fk reply: {error}") from None


def parse_info_reply(document: Document) -> InfoReply:
    """Validate the reply to an info.

    Raises:
        ReplyError: A required field is missing or wrong.
    """
    try:
        joint_names = _read_names(document, "joint_names")
        n = len(joint_names)
        return InfoReply(
            **_head(document),
            protocol=int(read_number(document, "protocol")),
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
        )
    except ValueError as error:
        raise ReplyError(f"info reply: {error}") from None


def _head(document: Document) -> dict[str, Any]:
    success = document.get("success")
    if not isinstance(success, bool):
        raise ValueError("success must be true or false")
    status = read_text(document, "status")
    if status not in _STATUSES:
        raise ValueError(f"status {status[:40]!r} is unknown")
    if _STATUSES[status].success is not success:
        raise ValueError(f"status {status} contradicts success {success}")
    return {
        "success": success,
        "error": read_text(document, "error_msg"),
        "status": _STATUSES[status],
        "id": read_id(document),
        "boot_id": read_text(document, "boot_id"),
    }


def _read_names(document: Document, name: str) -> list[str]:
    value = document.get(name)
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise ValueError(f"{name} must be a list of strings")
    return value
