"""What replies have in common, read from documents. Each reader returns trusted values or raises `ValueError`."""

from typing import Any

from ik_proto.fields import read_id, read_text
from ik_proto.messages import Document
from ik_proto.status import Status

STATUSES = {status.value: status for status in Status}
"""The statuses by their words."""


def read_head(document: Document) -> dict[str, Any]:
    """Read what every reply says."""
    success = document.get("success")
    if not isinstance(success, bool):
        raise ValueError("success must be true or false")
    status = read_text(document, "status")
    if status not in STATUSES:
        raise ValueError(f"status {status[:40]!r} is unknown")
    if STATUSES[status].success is not success:
        raise ValueError(f"status {status} contradicts success {success}")
    return {
        "success": success,
        "error": read_text(document, "error_msg"),
        "status": STATUSES[status],
        "id": read_id(document),
        "boot_id": read_text(document, "boot_id"),
    }


def read_pair(document: Document) -> tuple[str, str]:
    """Read the names of the nearest two capsules."""
    names = document.get("nearest")
    if not isinstance(names, list) or [type(name) for name in names] != [str, str]:
        raise ValueError("nearest must be two names")
    return names[0], names[1]
