"""Addresses to listen on: how they are written, who can reach them, and the error when one is taken."""

import ipaddress
from dataclasses import dataclass


class AddressError(ValueError):
    """An address that cannot be understood: one line that quotes it."""


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


@dataclass(frozen=True, slots=True)
class HostPort:
    """A TCP address.

    Attributes:
        host: Name or IP address.
        port: Port; 0 lets the system choose.
    """

    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> "HostPort":
        """Read "HOST:PORT"; an IPv6 host is in brackets.

        Raises:
            AddressError: Anything else.
        """
        host, colon, port = text.rpartition(":")
        bracketed = host.startswith("[") and host.endswith("]")
        if not colon or not host or not port.isascii() or not port.isdigit() or int(port) > 65535:
            raise AddressError(f"{text!r} is not an address like 127.0.0.1:12345")
        if ":" in host and not bracketed:
            raise AddressError(f"{text!r}: an IPv6 host goes in brackets, like [::1]:12345")
        return cls(host[1:-1] if bracketed else host, int(port))

    def __str__(self) -> str:
        """The form `parse` reads."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"

    @property
    def loopback(self) -> bool:
        """Whether only this machine can connect to it. A name other than localhost counts as reachable from outside."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


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
