"""What carries a request to a service and its reply back."""

import time
from collections.abc import Callable
from typing import Protocol

from ik_client.access import NO_ACCESS, Access
from ik_client.address import Address
from ik_proto import Codec


class Transport(Protocol):
    """Bytes there and back, one request at a time.

    Attributes:
        codec: How bodies are encoded.
        shows_token: Whether it shows the token by itself; where not, every request must carry it.
    """

    codec: Codec
    shows_token: bool

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


def open_transport(
    address: Address, clock: Callable[[], float] = time.monotonic, access: Access = NO_ACCESS
) -> Transport:
    """Make the transport an address asks for. Nothing is connected yet.

    Args:
        address: Where the service is.
        clock: Monotonic time [s].
        access: What to show, and whom to trust.

    Returns:
        A transport. The `zenoh` and `ssl` packages are imported only by those that need them.

    Raises:
        ValueError: A certificate or a configuration cannot be read, or the address has no use for it.
    """
    if address.scheme != "tls" and (access.ca or access.cert):
        raise ValueError(f"{address.url}: ca, cert and key are for tls:// addresses; Zenoh takes them in zenoh_config")
    if address.scheme != "zenoh" and access.zenoh_config:
        raise ValueError(f"{address.url}: zenoh_config is for zenoh:// addresses")
    if address.scheme == "tcp":
        from ik_client.transport_tcp import TcpTransport

        return TcpTransport(address, clock, access)
    if address.scheme == "tls":
        from ik_client.transport_tls import TlsTransport

        return TlsTransport(address, clock, access=access)
    from ik_client.transport_zenoh import ZenohTransport

    return ZenohTransport(address, clock, access)
