"""What the service is told: command line, configuration file, and the rules between the two.

The file is TOML with the names of the flags, without the dashes in front: `tcp = "127.0.0.1:12345"`, `openwbt-lag =
true`. A flag wins over the file, the file over the default. An unknown name or a wrong type is refused in one line.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from ik_proto import COLLISIONS, Collision
from ik_proto.host_port import AddressError, HostPort
from ik_proto.limits import DEFAULT_TCP, DEFAULT_ZENOH
from ik_service.addresses import locator_host

DEFAULT_HTTP = "127.0.0.1:12380"
"""Where health checks and metrics are served unless told otherwise [host:port]."""

DEFAULT_PRESET = "precise"
"""The preset of requests that name none, where the robot has it."""

OFF = "off"
CHOICES = {
    "collision": COLLISIONS,
    "smooth": ("none", "openwbt"),
    "kernel": ("auto", "c", "vm"),
    "log_format": ("auto", "json", "console"),
    "log_level": ("debug", "info", "warning", "error"),
}


class ConfigError(ValueError):
    """A setting that cannot be used: one line that names it."""


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of one run, checked.

    Attributes:
        robot: Packaged robot's name, or path of a description.
        preset: Cost used when a request names none; empty for `DEFAULT_PRESET`, or the only one of a robot without it.
        collision: What is done about self-collision when a request does not say: "off", "report" or "avoid".
        tcp: TCP JSON address [host:port], or "off".
        zenoh: Zenoh locator to listen on, or "off".
        zenoh_connect: Locator of a Zenoh router to join; empty for none.
        zenoh_config: Path of a Zenoh configuration (JSON5) that is passed through; empty for none.
        http: Health and metrics address [host:port], or "off".
        smooth: "openwbt" filters the answers to OpenWBT clients as their own server does, "none" does not.
        openwbt_lag: Answer OpenWBT clients with the result of their previous request, as their own server does.
        kernel: "c" compiles the solver, "vm" interprets it, "auto" compiles where a compiler is found.
        log_format: "json", "console", or "auto" for console on a terminal and JSON elsewhere.
        log_level: Least severe level that is logged.
        token_file: File with the token that every client must show; empty for none, or that of the environment.
        tls_cert: PEM file with the certificate of the TCP endpoint; empty for no TLS.
        tls_key: PEM file with its private key.
        tls_client_ca: PEM file with the authorities whose clients the TCP endpoint serves; empty for no certificates.
        replica: Serve beside another service of the same robot on the same Zenoh network.
        insecure: Accept addresses that other machines can reach, although nothing asks who they are.
    """

    robot: str = "g1"
    preset: str = ""
    collision: Collision = "avoid"
    tcp: str = DEFAULT_TCP
    zenoh: str = DEFAULT_ZENOH
    zenoh_connect: str = ""
    zenoh_config: str = ""
    http: str = DEFAULT_HTTP
    smooth: str = "none"
    openwbt_lag: bool = False
    kernel: str = "auto"
    log_format: str = "auto"
    log_level: str = "info"
    token_file: str = ""
    tls_cert: str = ""
    tls_key: str = ""
    tls_client_ca: str = ""
    replica: bool = False
    insecure: bool = False

    def __post_init__(self) -> None:
        """Check every setting, and those that depend on each other.

        Raises:
            ConfigError: With the setting at fault.
        """
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise ConfigError(f"{_flag(name)} must be one of {', '.join(choices)}, not {getattr(self, name)!r}")
        if self.tcp == OFF and self.zenoh == OFF:
            raise ConfigError("nothing to serve: --tcp and --zenoh are both off")
        if bool(self.tls_cert) != bool(self.tls_key):
            raise ConfigError("TLS needs both --tls-cert and --tls-key")
        if self.tls_client_ca and not self.tls_cert:
            raise ConfigError("--tls-client-ca asks for TLS: give --tls-cert and --tls-key too")
        try:
            for address in (self.tcp, self.http):
                if address != OFF:
                    HostPort.parse(address)
            if self.zenoh != OFF:
                locator_host(self.zenoh)
        except AddressError as error:
            raise ConfigError(str(error)) from None


def load_config(file: Path | None, flags: Mapping[str, Any]) -> Config:
    """Put together defaults, file and flags.

    Args:
        file: A TOML file, or None.
        flags: Settings given on the command line, by attribute name.

    Returns:
        The checked settings.

    Raises:
        ConfigError: The file cannot be read, or a setting is unknown or wrong.
    """
    settings = {} if file is None else _read(file)
    # Checked once, with everything in place: a flag may well repair what the file says.
    return replace(Config(), **{**settings, **flags})


def _read(file: Path) -> dict[str, Any]:
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{file}: cannot be read ({error})") from None
    defaults = Config()
    known = {field.name.replace("_", "-"): field.name for field in fields(Config)}
    settings: dict[str, Any] = {}
    for key, value in table.items():
        if key not in known:
            raise ConfigError(f"{file}: unknown setting {key!r}; there are {', '.join(sorted(known))}")
        expected = type(getattr(defaults, known[key]))
        if type(value) is not expected:
            kind = "true or false" if expected is bool else "a string"
            raise ConfigError(f"{file}: {key} must be {kind}, not {value!r}")
        settings[known[key]] = value
    return settings


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")
