"""Who may connect: pages that were served here, with the token of this run. Pure.

| asked for                       | who passes                                                                    |
|---------------------------------|-------------------------------------------------------------------------------|
| the page and the CA certificate | everybody; there is no secret in them, and nothing to change                  |
| a socket                        | who names an origin that is this server, and shows the token                  |

The origin keeps other sites out, which a browser would connect on their behalf; it must be the host that was asked, and
one this machine is known by, so that a name in the internet that leads here (DNS rebinding) is refused. The token keeps
everybody else in the network out.
"""

import hmac
import ipaddress
import re
from collections.abc import Iterable

_ORIGIN = re.compile(r"(https?)://(\[[0-9a-f:.]+\]|[a-z0-9.-]+)(?::(\d{1,5}))?")


class Door:
    """Decides who may open a socket."""

    def __init__(self, token: str, hosts: Iterable[str]) -> None:
        """Set the lock.

        Args:
            token: The secret of this run, not empty.
            hosts: Names and addresses of this machine, beside its loopback addresses.

        Raises:
            ValueError: The token is empty.
        """
        if not token:
            raise ValueError("the token must not be empty")
        self._token = token.encode()
        self.know(hosts)

    def know(self, hosts: Iterable[str]) -> None:
        """Take these names and addresses for this machine's, in the place of those before; from any thread."""
        self._hosts = {host.lower() for host in hosts}

    def origin_fault(self, origin: str | None, asked: str | None) -> str | None:
        """Say why an origin is refused.

        Args:
            origin: The header `Origin`.
            asked: The header `Host`.

        Returns:
            One line; None where it passes.
        """
        match = _ORIGIN.fullmatch((origin or "").lower())
        if match is None or origin is None:
            return "only pages served here may connect: open the URL that ik-xr printed"
        if origin.lower().split("://", 1)[1] != (asked or "").lower():
            return "this page was served by somebody else: open the URL that ik-xr printed"
        scheme, host, _ = match.groups()
        if not (_is_loopback(host) or host.strip("[]") in self._hosts):
            return "this machine is not known by that name: open the URL that ik-xr printed"
        if scheme == "http" and not _is_loopback(host):
            return "without TLS only localhost may connect: open the https URL that ik-xr printed"
        return None

    def token_fault(self, token: str | None) -> str | None:
        """Say why a token is refused, in constant time for all of the right length.

        Args:
            token: What was shown.

        Returns:
            One line; None where it passes.
        """
        if not token:
            return "the token is missing: open the whole URL that ik-xr printed, or scan its QR code"
        if not hmac.compare_digest(token.encode("utf-8", "replace"), self._token):
            return "wrong token: ik-xr was started anew; open the URL it prints now, or scan its QR code"
        return None


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"
