"""Sockets to listen at: one address, both families of addresses, or the loopback addresses of both."""

import errno
import socket
from ipaddress import ip_address

_TRIES = 8


class ListenError(ValueError):
    """A port cannot be listened at; says why, in one line."""


def listen(host: str, port: int) -> list[socket.socket]:
    """Listen.

    Args:
        host: Numeric address; `::` takes IPv4 too; `localhost` is 127.0.0.1, and ::1 where there is one.
        port: TCP port; 0 lets the system choose.

    Returns:
        The sockets, all of one port.

    Raises:
        ListenError: The host is no address, the port is taken, or the system does not allow it.
    """
    if host != "localhost":
        return [_listen(host, port)]
    for _ in range(_TRIES):
        first = _listen("127.0.0.1", port)
        try:
            return [first, _listen("::1", first.getsockname()[1])]
        except ListenError as refused:
            cause = refused.__cause__
            if not (isinstance(cause, OSError) and cause.errno == errno.EADDRINUSE):
                return [first]  # this machine has no IPv6
            first.close()
            # Browsers ask ::1 first: whoever listens there would get the page's token.
            if port:
                raise
    raise ListenError("cannot listen at localhost: no port is free at both 127.0.0.1 and ::1")


def _listen(host: str, port: int) -> socket.socket:
    shown = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    try:
        address = ip_address(host)
    except ValueError:
        raise ListenError(f"cannot listen at {host}: give a numeric address, such as 0.0.0.0 or ::") from None
    family = socket.AF_INET if address.version == 4 else socket.AF_INET6
    made = None
    try:
        made = socket.socket(family, socket.SOCK_STREAM)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if address.version == 6:
            made.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, not address.is_unspecified)
        made.bind((host, port))
        made.listen(128)
        return made
    except OSError as error:
        if made is not None:
            made.close()
        taken = "another program listens there" if error.errno == errno.EADDRINUSE else error.strerror
        raise ListenError(f"cannot listen at {shown}: {taken}") from error
