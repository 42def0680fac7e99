"""The rule for addresses that other machines can reach: something must ask those machines who they are.

A token does, and so do client certificates; for Zenoh, users or certificates that its passed-through configuration
demands; or `--insecure` says that nothing shall. A loopback address needs none of them.
"""

import json
from typing import TYPE_CHECKING

from ik_proto.host_port import AddressError, HostPort
from ik_service.addresses import locator_host
from ik_service.config import OFF, Config, ConfigError

if TYPE_CHECKING:
    import zenoh

_TOKEN = "--token-file FILE (ik-service token FILE makes one)"
_INSECURE = "--insecure to do without"


def check_tcp_and_http(config: Config, has_token: bool) -> None:
    """Apply the rule to the TCP and the HTTP address.

    Args:
        config: The settings.
        has_token: Whether a token will be demanded.

    Raises:
        ConfigError: An address is exposed and nothing asks.
        AddressError: An address is none.
    """
    if config.insecure or has_token:
        return
    if config.tcp != OFF and not config.tls_client_ca and not HostPort.parse(config.tcp).loopback:
        raise _exposed("--tcp", config.tcp, f"{_TOKEN}, --tls-client-ca, or {_INSECURE}")
    if config.http != OFF and not HostPort.parse(config.http).loopback:
        raise _exposed("--http", config.http, f"{_TOKEN}, or {_INSECURE}")


def check_zenoh(config: Config, has_token: bool, session: "zenoh.Config") -> None:
    """Apply the rule to where the Zenoh session listens, and to a router it joins: who reaches that reaches us.

    Args:
        config: The settings.
        has_token: Whether a token will be demanded.
        session: The session's whole configuration.

    Raises:
        ConfigError: A locator is exposed and nothing asks.
        AddressError: A locator is none.
    """
    if config.insecure or has_token:
        return
    flag = "--zenoh-config" if config.zenoh_config else "--zenoh"
    ways = f"{_TOKEN}, users or certificates in --zenoh-config, or {_INSECURE}"
    for locator in _locators(session, "listen/endpoints"):
        if _is_exposed(locator) and not _listener_asks(session, locator):
            raise _exposed(flag, locator, ways)
    for locator in _locators(session, "connect/endpoints"):
        # Whom a router lets in is its own configuration; one without a certificate has none worth the name.
        if _is_exposed(locator) and not _is_encrypted(locator):
            raise ConfigError(
                f"whoever reaches the router {locator} reaches this service, and nothing would ask who they are: "
                f"give {_TOKEN}, a router with a certificate (tls/HOST:PORT), or {_INSECURE}"
            )


def _exposed(flag: str, address: str, ways: str) -> ConfigError:
    return ConfigError(
        f"{flag} {address} lets other machines in, and nothing would ask who they are: give {ways}; "
        "a loopback address like 127.0.0.1 needs none"
    )


def _is_exposed(locator: str) -> bool:
    host = locator_host(locator)
    return host is not None and not host.loopback


def _listener_asks(session: "zenoh.Config", locator: str) -> bool:
    users = json.loads(session.get_json("transport/auth/usrpwd"))["dictionary_file"]
    certificates = json.loads(session.get_json("transport/link/tls"))["enable_mtls"]
    return bool(users) or (bool(certificates) and _is_encrypted(locator))


def _is_encrypted(locator: str) -> bool:
    return locator.partition("/")[0] in ("tls", "quic")


def _locators(session: "zenoh.Config", key: str) -> list[str]:
    """The locators of the session's own mode."""
    endpoints = json.loads(session.get_json(key))
    if isinstance(endpoints, dict):
        endpoints = endpoints.get(json.loads(session.get_json("mode")), [])
    if not all(isinstance(locator, str) for locator in endpoints):
        raise AddressError(f"{key} of the Zenoh configuration must be a list of locators like tcp/127.0.0.1:7447")
    return endpoints
