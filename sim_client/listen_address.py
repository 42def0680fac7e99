"""Where to listen: how it is written, and who can reach it."""

import ipaddress
from dataclasses import dataclass

from sim_client.settings import SettingsError


@dataclass(frozen=True, slots=True)
class ListenAddress:
    """A TCP address.

    Attributes:
        host: Name or IP address.
        port: Port; 0 lets the system choose.
    """

    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> "ListenAddress":
        """Read "HOST:PORT"; an IPv6 host is in brackets.

        Raises:
            SettingsError: Anything else.
        """
        host, _, port = text.rpartition(":")
        bracketed = host.startswith("[") and host.endswith("]")
        sound = host and port.isascii() and port.isdigit() and int(port) <= 65535 and (bracketed or ":" not in host)
        if not sound:
            raise SettingsError(f"--listen {text}: must be an address like 127.0.0.1:12346, or [::1]:12346")
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
