"""The addresses a client takes, and what it says of others."""

import pytest

from ik_client import IKClient
from ik_client.address import parse_address


@pytest.mark.parametrize(
    "url",
    [
        "",
        "127.0.0.1:1",
        "http://127.0.0.1:1",
        "tcp://127.0.0.1",
        "tcp://:1",
        "tcp://h:99999",
        "tcp://h:1/g1",
        "zenoh://h:1/a/b",
    ],
)
def test_a_wrong_address_names_the_right_forms(url):
    with pytest.raises(
        ValueError, match="tcp://HOST:PORT, tls://HOST:PORT, zenoh://HOST:PORT or zenoh://HOST:PORT/ROBOT"
    ):
        IKClient(url)


@pytest.mark.parametrize(
    ("url", "scheme", "host", "port", "robot", "authority"),
    [
        ("tcp://127.0.0.1:12345", "tcp", "127.0.0.1", 12345, "", "127.0.0.1:12345"),
        ("tcp://[::1]:12345", "tcp", "::1", 12345, "", "[::1]:12345"),
        ("zenoh://robot:7447", "zenoh", "robot", 7447, "", "robot:7447"),
        ("zenoh://robot:7447/g1", "zenoh", "robot", 7447, "g1", "robot:7447"),
    ],
)
def test_addresses(url, scheme, host, port, robot, authority):
    address = parse_address(url)
    assert (address.scheme, address.host, address.port, address.robot) == (scheme, host, port, robot)
    assert address.authority == authority
