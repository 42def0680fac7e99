"""TCP addresses: how they are written, and who can reach them."""

import ipaddress
from dataclasses import dataclass


class AddressError(ValueError):
    """An address that cannot be understood: one line that quotes it."""


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
