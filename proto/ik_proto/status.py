"""What a reply says of its request: one enum, and the table that explains it.

The table is the single source: the service sets `success` from it, the client tells an answer from a refusal by it, and
a test holds `proto/README.md` to it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Status(StrEnum):
    """Outcome of one request."""

    OK = "ok"
    UNREACHABLE = "unreachable"
    BLOCKED = "blocked"
    NOT_CONVERGED = "not_converged"
    BAD_REQUEST = "bad_request"
    UNSUPPORTED = "unsupported"
    OVERLOADED = "overloaded"
    SUPERSEDED = "superseded"
    EXPIRED = "expired"
    UNAUTHORIZED = "unauthorized"
    INTERNAL = "internal"

    @property
    def success(self) -> bool:
        """Whether the answer may be followed."""
        return STATUS_TABLE[self].success


@dataclass(frozen=True, slots=True)
class StatusInfo:
    """One row of the status table.

    Attributes:
        success: Whether `sol_q` may be followed.
        meaning: What happened.
        action: What a client does about it.
    """

    success: bool
    meaning: str
    action: str


STATUS_TABLE: dict[Status, StatusInfo] = {
    Status.OK: StatusInfo(True, "solved; the residuals say how close each wrist is", "follow"),
    Status.UNREACHABLE: StatusInfo(
        True,
        "solved to the optimum, but a wrist stays further from its target than the preset tolerates",
        "follow, and tell the operator",
    ),
    Status.BLOCKED: StatusInfo(
        True,
        "the body is in the way of a target; `sol_q` is the nearest answer found that keeps the clearance margin",
        "follow, and tell the operator",
    ),
    Status.NOT_CONVERGED: StatusInfo(
        False, "the solver stopped before the optimum; `sol_q` echoes the request's `q`", "hold"
    ),
    Status.BAD_REQUEST: StatusInfo(
        False,
        "the message is malformed, not finite, of the wrong shape, or a pose is not a rigid transform",
        "fix the client",
    ),
    Status.UNSUPPORTED: StatusInfo(
        False, "the verb, preset or protocol version is unknown to this service", "ask `info`, or update"
    ),
    Status.OVERLOADED: StatusInfo(
        False,
        "the service has no room for this connection or for one more long request, or it is stopping",
        "hold, retry later",
    ),
    Status.SUPERSEDED: StatusInfo(
        False, "a newer request of the same stream came while this one waited", "take the newer one's answer"
    ),
    Status.EXPIRED: StatusInfo(
        False, "`budget_ms` ran out while the request waited; it was not solved", "hold, go on with the next target"
    ),
    Status.UNAUTHORIZED: StatusInfo(
        False, "the service demands a token, and this request showed none or a wrong one", "show the token"
    ),
    Status.INTERNAL: StatusInfo(False, "a fault in the service, written to its log", "hold, report it"),
}

ANSWERS = (Status.OK, Status.UNREACHABLE, Status.BLOCKED, Status.NOT_CONVERGED)
"""What a solve can come to, the better first; every other status is a refusal."""


def gravest(statuses: Iterable[Status]) -> Status:
    """Sum up a batch: the gravest status of its rows stands for all, so that success means success of every row.

    Args:
        statuses: One of `ANSWERS` for each row; at least one.

    Returns:
        The one furthest down in `ANSWERS`.
    """
    return max(statuses, key=ANSWERS.index)
