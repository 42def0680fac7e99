"""Where a headset finds this machine: its addresses, the page's URL, a QR code of it in the terminal."""

import io
import ipaddress
import socket
import struct
from ipaddress import IPv4Address, IPv6Address
from pathlib import Path

PERMITTED_NETWORKS = tuple(
    ipaddress.ip_network(text)
    for text in (
        *("10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16", "100.64.0.0/10", "127.0.0.0/8"),
        *("fc00::/7", "::1/128"),
    )
)
"""Networks that are nobody's in particular: the only ones our certificates speak for."""

_SIOCGIFADDR = 0x8915
_IPV6_INTERFACES = Path("/proc/net/if_inet6")


def local_addresses(*, ipv6: bool = False) -> list[IPv4Address | IPv6Address]:
    """The addresses of this machine in private networks, the one of the default route first; without loopback.

    Args:
        ipv6: Those of IPv6 too, behind the others: unique local ones (RFC 4193).
    """
    candidates: list[IPv4Address | IPv6Address | None] = [_routed_address()]
    candidates += [_interface_address(name) for _, name in socket.if_nameindex()]
    if ipv6:
        candidates += _ipv6_addresses()
    distinct = dict.fromkeys(address for address in candidates if address is not None)
    return [address for address in distinct if not address.is_loopback and is_permitted(address)]


def is_permitted(address: IPv4Address | IPv6Address) -> bool:
    """Whether an address is in a private network."""
    return any(address in network for network in PERMITTED_NETWORKS)


def host_names() -> list[str]:
    """Names a headset may know this machine by: as multicast DNS has it, and its own. Lower case."""
    name = socket.gethostname().lower().rstrip(".")
    short = name.split(".")[0]
    return list(dict.fromkeys([f"{short}.local", name])) if short and short != "localhost" else []


def page_url(host: str, port: int, token: str, *, secure: bool, path: str = "/") -> str:
    """The page's address, with the token after a #, which browsers keep to themselves.

    Args:
        host: Name or address.
        port: TCP port.
        token: The secret of this run.
        secure: Whether the page is served over TLS.
        path: Of the page.
    """
    place = f"[{host}]" if ":" in host else host
    return f"{'https' if secure else 'http'}://{place}:{port}{path}#{token}"


def qr_code(url: str) -> str:
    """A URL as a QR code of text for a terminal, two rows of modules in a line; needs segno."""
    import segno

    out = io.StringIO()
    segno.make(url, error="l").terminal(out, compact=True)
    return out.getvalue()


def usb_route(url: str, port: int) -> str:
    """How a headset on a USB cable gets to the page without a certificate, in words.

    Args:
        url: The page's URL on this machine, over plain HTTP.
        port: Its port.
    """
    return f"over a USB cable: adb reverse tcp:{port} tcp:{port}, then open {url} in the headset"


def _routed_address() -> IPv4Address | None:
    """The address that packets to elsewhere would come from. Connecting a UDP socket sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # an address for documentation (RFC 5737)
            return IPv4Address(probe.getsockname()[0])
        except OSError:
            return None


def _interface_address(name: str) -> IPv4Address | None:
    """The first address of an interface; None where it has none, or the system does not tell in this way."""
    try:
        import fcntl
    except ImportError:
        return None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        request = struct.pack("256s", name.encode()[:15])
        try:
            return IPv4Address(fcntl.ioctl(probe.fileno(), _SIOCGIFADDR, request)[20:24])
        except OSError:
            return None


def _ipv6_addresses() -> list[IPv6Address | None]:
    """The IPv6 addresses of all interfaces; none where the system does not tell in this way."""
    try:
        lines = _IPV6_INTERFACES.read_text().splitlines()
    except OSError:
        return []
    return [IPv6Address(int(line.split()[0], 16)) for line in lines]
