"""The client's errors. Each message is one line that says what is wrong and what to do.

- `IKError`: base of all.
    - `ServiceUnavailable`: nobody answers at the address.
    - `ServiceTimeout`: somebody is there, and no answer came in time.
    - `Refused`: the service answered that it will not or cannot serve the request (`overloaded`, `superseded`,
      `expired`, `internal`).
        - `BadRequest`: the request is at fault (`bad_request`, `unsupported`), found here or by the service.
        - `Unauthorized`: the service demands a token, and got none or a wrong one (`unauthorized`).
    - `ProtocolMismatch`: what answers does not speak this protocol.
"""

from ik_proto import Reply, Status


class IKError(Exception):
    """Base of the client's errors."""


class ServiceUnavailable(IKError):
    """Nobody answers at the address.

    Attributes:
        url: The address.
    """

    def __init__(self, url: str, message: str) -> None:
        """Put the address in front of the message."""
        super().__init__(f"{url}: {message}")
        self.url = url


class ServiceTimeout(IKError):
    """No answer came in time.

    Attributes:
        url: The address.
        timeout: How long the call was allowed to take [s].
    """

    def __init__(self, url: str, timeout: float) -> None:
        """Remember the numbers."""
        super().__init__(f"{url}: no answer within {timeout:.3g} s")
        self.url = url
        self.timeout = timeout


class Refused(IKError):
    """The service will not or cannot serve the request.

    Attributes:
        status: Why.
        reply: What the service said; None where the request was refused before it was sent.
    """

    def __init__(self, status: Status, message: str, reply: Reply | None = None) -> None:
        """Put the status in front of the message."""
        super().__init__(f"{status}: {message}")
        self.status = status
        self.reply = reply


class BadRequest(Refused):
    """The request is at fault."""


class Unauthorized(Refused):
    """The service demands a token, and got none or a wrong one."""

    def __init__(self, shown: bool, reply: Reply) -> None:
        """Say what to do.

        Args:
            shown: Whether the client has shown a token.
            reply: What the service said.
        """
        what = "the service demands another token than the one shown" if shown else "the service demands a token"
        super().__init__(Status.UNAUTHORIZED, f"{what}; pass its token as token, or in IK_TOKEN", reply)


class ProtocolMismatch(IKError):
    """What answers does not speak this protocol.

    Attributes:
        url: The address.
    """

    def __init__(self, url: str, message: str) -> None:
        """Put the address in front of the message."""
        super().__init__(f"{url} does not speak the protocol of this client: {message}")
        self.url = url
