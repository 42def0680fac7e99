"""What carries a request to a service and its reply back."""

import time
from collections.abc import Callable
from typing import Protocol

from ik_client.address import Address
from ik_proto import Codec


class Transport(Protocol):
    """Bytes there and back, one request at a time."""

    codec: Codec

    def request(self, body: bytes, deadline: float) -> bytes:
        """Send a request and wait for its reply; connect, reconnect or fail over as needed.

        Args:
            body: Encoded request.
            deadline: When to give up, on the transport's clock [s].

        Returns:
            Encoded reply to this very request.

        Raises:
            ServiceUnavailable: Nobody is there. Told before the deadline where that is known.
            TimeoutError: Somebody is there, and the deadline has passed.
            ProtocolError: What came is no frame.
        """
        ...

    def reset(self) -> None:
        """Start afresh with the next request: what is connected now has answered out of step."""
        ...

    def close(self) -> None:
        """Release everything, in bounded time."""
        ...


def open_transport(address: Address, clock: Callable[[], float] = time.monotonic) -> Transport:
    """Make the transport an address asks for. Nothing is connected yet.

    Args:
        address: Where the service is.
        clock: Monotonic time [s].

    Returns:
        A transport. The `zenoh` package is imported only by the one that needs it.
    """
    if address.scheme == "tcp":
        from ik_client.transport_tcp import TcpTransport

        return TcpTransport(address, clock)
    from ik_client.transport_zenoh import ZenohTransport

    return ZenohTransport(address, clock)
