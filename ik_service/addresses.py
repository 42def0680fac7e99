"""Addresses to listen on: the error when one is taken, and the address in a Zenoh locator."""

from ik_proto.host_port import AddressError, HostPort


class AddressInUse(OSError):
    """Another process listens on an address.

    Attributes:
        address: The address as it was given.
        flag: The option that moves this service elsewhere.
    """

    def __init__(self, address: str, flag: str) -> None:
        """Say what is taken and how to go on."""
        super().__init__(
            f"{address} is in use, by another ik-service perhaps: stop that one, or choose another address with {flag}"
        )
        self.address = address
        self.flag = flag


_LOCAL_PROTOCOLS = ("unixsock-stream", "unixpipe", "vsock", "serial")


def locator_host(locator: str) -> HostPort | None:
    """Find the host a Zenoh locator such as "tcp/127.0.0.1:7447" listens on.

    Args:
        locator: PROTOCOL/ADDRESS, with optional "?metadata" and "#config".

    Returns:
        The address, or None for a protocol that stays on this machine.

    Raises:
        AddressError: Not a locator.
    """
    protocol, slash, rest = locator.partition("/")
    if not slash or not protocol or not rest:
        raise AddressError(f"{locator!r} is not a Zenoh locator like tcp/127.0.0.1:7447")
    if protocol in _LOCAL_PROTOCOLS:
        return None
    return HostPort.parse(rest.partition("?")[0].partition("#")[0])
