"""Where the web server listens: addresses of both families, ports that are taken."""

import socket
from collections.abc import Iterator

import pytest

from xr_client import listening
from xr_client.listening import ListenError, listen


@pytest.fixture
def opened() -> Iterator[list[socket.socket]]:
    sockets: list[socket.socket] = []
    yield sockets
    for one in sockets:
        one.close()


def reach(host: str, port: int) -> None:
    socket.create_connection((host, port), timeout=5.0).close()


@pytest.fixture
def ipv6() -> None:
    try:
        with socket.socket(socket.AF_INET6) as probe:
            probe.bind(("::1", 0))
    except OSError:
        pytest.skip("this machine has no IPv6")


def test_localhost_is_both_loopback_addresses(opened, ipv6):
    opened += listen("localhost", 0)
    ports = {one.getsockname()[1] for one in opened}
    assert len(opened) == 2
    assert len(ports) == 1
    for host in ("127.0.0.1", "::1"):
        reach(host, *ports)


def test_without_ipv6_it_is_one(opened, monkeypatch):
    def absent(*arguments):
        if arguments[0] == socket.AF_INET6:
            raise OSError(97, "Address family not supported by protocol")
        return real(*arguments)

    real = socket.socket
    monkeypatch.setattr(listening.socket, "socket", absent)
    opened += listen("localhost", 0)
    assert [one.family for one in opened] == [socket.AF_INET]


def test_everywhere_is_both_families(opened, ipv6):
    opened += listen("::", 0)
    port = opened[0].getsockname()[1]
    for host in ("127.0.0.1", "::1"):
        reach(host, port)


def test_one_address_is_no_other(opened, ipv6):
    opened += listen("::1", 0)
    with pytest.raises(OSError, match="refused"):
        reach("127.0.0.1", opened[0].getsockname()[1])


def test_somebody_else_behind_localhost_is_told(opened, ipv6):
    """Browsers ask ::1 first: whoever listens there would get the token."""
    opened += listen("::1", 0)
    port = opened[0].getsockname()[1]
    with pytest.raises(ListenError, match=rf"\[::1\]:{port}: another program"):
        listen("localhost", port)
    opened += listen("127.0.0.1", port)  # nothing was left open


@pytest.mark.parametrize("host", ["robot.local", "1.2.3", ""])
def test_a_name_is_no_address(host):
    with pytest.raises(ListenError, match="give a numeric address"):
        listen(host, 0)


def test_an_address_of_another_machine_is_told():
    with pytest.raises(ListenError, match=r"192\.0\.2\.1:0: .*assign"):
        listen("192.0.2.1", 0)
