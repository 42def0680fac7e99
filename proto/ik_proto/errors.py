"""The errors of the wire contract.

- `ProtocolError`: base of all.
    - `FrameTooLarge`: a length prefix announces more than the limit; the stream cannot be followed any further.
    - `DecodeError`: a body is not JSON, or not MessagePack.
    - `RequestError`: a decoded request breaks the contract; carries the status and whatever of it could be read.
    - `ReplyError`: a reply breaks the contract.
    - `RowError`: one row of a batch's array breaks it; the reader of the field turns it into one of the two above.
"""

from typing import Any

from ik_proto.status import Status


class ProtocolError(ValueError):
    """Base of the wire contract's errors."""


class FrameTooLarge(ProtocolError):
    """A length prefix beyond the limit.

    Attributes:
        length: Announced body length [bytes].
        limit: Largest body accepted [bytes].
        frames_before: Bodies that were complete before it, oldest first.
    """

    def __init__(self, length: int, limit: int, frames_before: list[bytes] | None = None) -> None:
        """Remember the numbers and what came before."""
        super().__init__(f"frame of {length} bytes announced, at most {limit} are accepted")
        self.length = length
        self.limit = limit
        self.frames_before = frames_before or []


class DecodeError(ProtocolError):
    """A body that is not a well-formed document."""


class RequestError(ProtocolError):
    """A request that breaks the contract.

    Attributes:
        status: The status its reply carries.
        id: The request's id where it could be read, else 0.
        q: The request's joint positions where they could be read [rad], else None.
    """

    def __init__(self, message: str, status: Status = Status.BAD_REQUEST, id: int = 0, q: Any = None) -> None:
        """Keep what the reply needs."""
        super().__init__(message)
        self.status = status
        self.id = id
        self.q = q


class ReplyError(ProtocolError):
    """A reply that breaks the contract."""


class RowError(ProtocolError):
    """One row of a batch's array breaks the contract.

    Attributes:
        row: Its index.
    """

    def __init__(self, row: int, message: str) -> None:
        """Remember which row it is."""
        super().__init__(message)
        self.row = row
