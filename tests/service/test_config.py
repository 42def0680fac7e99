"""Settings: defaults, file, flags, and one line for every mistake."""

from pathlib import Path

import pytest

from ik_proto.host_port import AddressError, HostPort
from ik_service.addresses import locator_host
from ik_service.config import Config, ConfigError, load_config


def write(folder: Path, text: str) -> Path:
    file = folder / "service.toml"
    file.write_text(text)
    return file


def test_flags_win_over_the_file_and_the_file_over_defaults(tmp_path: Path) -> None:
    file = write(tmp_path, 'tcp = "127.0.0.1:1"\nhttp = "off"\nopenwbt-lag = true\n')
    config = load_config(file, {"tcp": "127.0.0.1:2"})
    assert (config.tcp, config.http, config.openwbt_lag) == ("127.0.0.1:2", "off", True)
    assert config.zenoh == Config().zenoh


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('tpc = "127.0.0.1:1"', "tpc"),
        ("tcp = 12345", "tcp must be a string"),
        ('openwbt-lag = "yes"', "openwbt-lag must be true or false"),
        ('collision = "maybe"', "--collision must be one of off, report, avoid"),
        ('smooth = "very"', "--smooth must be one of none, openwbt"),
        ('tcp = "12345"', "'12345' is not an address"),
        ('tcp = "127.0.0.1:99999"', "not an address"),
        ('zenoh = "127.0.0.1:7447"', "not a Zenoh locator"),
        ('tcp = "off"\nzenoh = "off"', "nothing to serve"),
        ("this is not TOML", "cannot be read"),
        ('token = "a-secret-in-a-file-of-settings"', "unknown setting 'token'"),
        ('tls-cert = "service.pem"', "both --tls-cert and --tls-key"),
        ('tls-key = "service.key"', "both --tls-cert and --tls-key"),
        ('tls-client-ca = "ca.pem"', "--tls-client-ca asks for TLS"),
        ('replica = "yes"', "replica must be true or false"),
    ],
)
def test_a_mistake_is_one_line_that_names_it(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(write(tmp_path, text), {})
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.toml: cannot be read"):
        load_config(tmp_path / "nowhere.toml", {})


@pytest.mark.parametrize("text", ["127.0.0.1:12345", "[::1]:0", "localhost:65535"])
def test_an_address_is_written_as_it_is_read(text: str) -> None:
    assert str(HostPort.parse(text)) == text


@pytest.mark.parametrize("text", ["", ":1", "host", "host:", "host:x", "host:-1", "::1:80", "host:65536"])
def test_what_is_no_address(text: str) -> None:
    with pytest.raises(AddressError):
        HostPort.parse(text)


def test_a_locator_has_a_host() -> None:
    assert locator_host("tcp/127.0.0.1:7447#iface=lo") == HostPort("127.0.0.1", 7447)
    with pytest.raises(AddressError):
        locator_host("tcp/")
