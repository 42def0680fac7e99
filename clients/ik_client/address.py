"""The addresses a client takes: `tcp://HOST:PORT`, `tls://HOST:PORT` and `zenoh://HOST:PORT[/ROBOT]`."""

from dataclasses import dataclass
from typing import Literal
from urllib.parse import urlsplit

FORMS = "tcp://HOST:PORT, tls://HOST:PORT, zenoh://HOST:PORT or zenoh://HOST:PORT/ROBOT"


@dataclass(frozen=True, slots=True)
class Address:
    """Where a service is, and how to speak to it.

    Attributes:
        scheme: "tcp" for JSON over TCP, "tls" for the same encrypted, "zenoh" for MessagePack over Zenoh.
        host: Name or IP address, without brackets.
        port: TCP port.
        robot: Robot to ask for (Zenoh only); empty for the only one there is.
        url: The address as it was given.
    """

    scheme: Literal["tcp", "tls", "zenoh"]
    host: str
    port: int
    robot: str
    url: str

    @property
    def authority(self) -> str:
        """Host and port as they are written in an address."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def parse_address(url: str) -> Address:
    """Read an address.

    Args:
        url: What a person wrote.

    Returns:
        Its parts.

    Raises:
        ValueError: It has none of the known forms; one line that names them.
    """
    fault = ValueError(f"{url!r} is no address of a service; write {FORMS}")
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        raise fault from None
    robot = parts.path.strip("/")
    if parts.scheme not in ("tcp", "tls", "zenoh") or not host or not port or parts.query or parts.fragment:
        raise fault
    if "/" in robot or "*" in robot or (robot and parts.scheme != "zenoh"):
        raise fault
    return Address(parts.scheme, host, port, robot, url)
