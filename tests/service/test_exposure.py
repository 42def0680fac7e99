"""Addresses that other machines can reach: refused unless something asks who they are."""

import json
from typing import Any

import pytest

from ik_proto.host_port import AddressError
from ik_service.config import Config, ConfigError
from ik_service.exposure import check_tcp_and_http, check_zenoh
from ik_service.zenoh_server import zenoh_config

TLS_FILES: dict[str, Any] = {"tls_cert": "service.pem", "tls_key": "service.key"}
USERS = {"transport/auth/usrpwd": {"user": None, "password": None, "dictionary_file": "users.txt"}}
CERTIFICATES = {"transport/link/tls/enable_mtls": True}


def check(config: Config, session: dict[str, Any] | None = None, has_token: bool = False) -> None:
    check_tcp_and_http(config, has_token)
    zenoh = zenoh_config(config.zenoh, config.zenoh_connect)
    for key, value in (session or {}).items():
        zenoh.insert_json5(key, json.dumps(value))
    check_zenoh(config, has_token, zenoh)


def test_the_defaults_are_loopback_and_need_nothing() -> None:
    """Hazard row: auth."""
    check(Config())
    assert Config().tcp.startswith("127.0.0.1:")
    assert Config().http.startswith("127.0.0.1:")
    assert Config().zenoh.startswith("tcp/127.0.0.1:")


@pytest.mark.parametrize(
    "settings",
    [
        {"tcp": "localhost:1"},
        {"tcp": "127.1.2.3:1"},
        {"tcp": "[::1]:1"},
        {"zenoh": "unixsock-stream//tmp/ik.sock"},
        {"zenoh": "udp/127.0.0.1:7447?iface=lo"},
        {"zenoh_connect": "tcp/127.0.0.1:7447"},
        {"tcp": "off"},
        {"http": "off"},
    ],
)
def test_addresses_of_this_machine_need_nothing(settings: dict[str, Any]) -> None:
    check(Config(**settings))


@pytest.mark.parametrize(
    ("settings", "ways"),
    [
        ({"tcp": "0.0.0.0:12345"}, ["--token-file", "--tls-client-ca", "--insecure"]),
        ({"tcp": "[::]:12345"}, ["--token-file", "--tls-client-ca", "--insecure"]),
        ({"tcp": "robot.local:12345"}, ["--token-file", "--tls-client-ca", "--insecure"]),
        ({"tcp": "0.0.0.0:12345", **TLS_FILES}, ["--token-file", "--tls-client-ca", "--insecure"]),
        ({"http": "192.168.1.5:80"}, ["--token-file", "--insecure"]),
        ({"zenoh": "tcp/0.0.0.0:7447"}, ["--token-file", "--zenoh-config", "--insecure"]),
        ({"zenoh": "tls/[::]:7447"}, ["--token-file", "--zenoh-config", "--insecure"]),
        ({"zenoh_connect": "tcp/10.0.0.1:7447"}, ["--token-file", "router with a certificate", "--insecure"]),
    ],
)
def test_other_addresses_are_refused_in_one_line_with_the_ways_out(settings: dict[str, Any], ways: list[str]) -> None:
    """Hazard row: auth."""
    with pytest.raises(ConfigError, match="nothing would ask who they are") as caught:
        check(Config(**settings))
    for way in ways:
        assert way in str(caught.value)
    assert "\n" not in str(caught.value)
    check(Config(**settings), has_token=True)
    check(Config(**settings, insecure=True))


def test_client_certificates_guard_the_tcp_endpoint_alone() -> None:
    files: dict[str, Any] = {**TLS_FILES, "tls_client_ca": "ca.pem"}
    check(Config(tcp="0.0.0.0:12345", **files))
    with pytest.raises(ConfigError, match="--http"):
        check(Config(tcp="0.0.0.0:12345", http="0.0.0.0:80", **files))
    with pytest.raises(ConfigError, match="--zenoh"):
        check(Config(tcp="0.0.0.0:12345", zenoh="tcp/0.0.0.0:7447", **files))


def test_a_zenoh_configuration_guards_itself_by_users_or_certificates() -> None:
    check(Config(zenoh="tcp/0.0.0.0:7447"), USERS)
    check(Config(zenoh="tls/0.0.0.0:7447"), CERTIFICATES)
    check(Config(zenoh="quic/0.0.0.0:7447"), CERTIFICATES)
    with pytest.raises(ConfigError, match=r"tcp/0\.0\.0\.0"):
        check(Config(zenoh="tcp/0.0.0.0:7447"), CERTIFICATES)  # which plain TCP does not ask for


def test_what_a_zenoh_configuration_listens_on_counts() -> None:
    listen = {"listen/endpoints": ["tcp/127.0.0.1:1", "tcp/0.0.0.0:2"]}
    with pytest.raises(ConfigError, match=r"tcp/0\.0\.0\.0:2"):
        check(Config(), listen)
    with pytest.raises(ConfigError, match=r"tcp/0\.0\.0\.0:2"):
        check(Config(), {"listen/endpoints": {"peer": ["tcp/0.0.0.0:2"]}})
    check(Config(), {"listen/endpoints": {"peer": ["tcp/127.0.0.1:1"], "router": ["tcp/0.0.0.0:2"]}})  # another mode


def test_a_router_behind_a_certificate_decides_itself_whom_it_lets_in() -> None:
    check(Config(zenoh_connect="tls/10.0.0.1:7447"))


def test_nonsense_is_told_as_such() -> None:
    with pytest.raises(AddressError):
        check(Config(), {"listen/endpoints": ["tcp/nowhere"]})
