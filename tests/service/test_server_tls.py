"""What the service reads for TLS: one line for every file that is wrong, and no older version than 1.2."""

import ssl
from pathlib import Path

import pytest
from certificates import make_certificates
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    PrivateFormat,
    load_pem_private_key,
)

from ik_service.config import ConfigError
from ik_service.tls import server_context


@pytest.fixture(scope="module")
def pem(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = make_certificates(tmp_path_factory.mktemp("pem"))
    key = load_pem_private_key((folder / "service.key").read_bytes(), None)
    (folder / "locked.key").write_bytes(
        key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"passphrase"))
    )
    return folder


def test_versions_before_1_2_are_not_spoken(pem: Path) -> None:
    context = server_context(str(pem / "service.pem"), str(pem / "service.key"))
    assert context.minimum_version == ssl.TLSVersion.TLSv1_2
    assert context.verify_mode == ssl.CERT_NONE


def test_with_an_authority_every_client_must_show_a_certificate(pem: Path) -> None:
    context = server_context(str(pem / "service.pem"), str(pem / "service.key"), str(pem / "ca.pem"))
    assert context.verify_mode == ssl.CERT_REQUIRED


@pytest.mark.parametrize(
    ("certificate", "key", "client_ca", "words"),
    [
        ("nowhere.pem", "service.key", "", "nowhere.pem: cannot be read"),
        ("service.pem", "nowhere.key", "", "nowhere.key: cannot be read"),
        ("service.pem", "client.key", "", "do not belong together"),
        ("service.key", "service.key", "", "are no PEM certificate and key"),
        ("service.pem", "locked.key", "", "is protected by a passphrase"),
        ("service.pem", "service.key", "nowhere.pem", "nowhere.pem: cannot be read"),
        ("service.pem", "service.key", "service.key", "holds no PEM certificate"),
    ],
)
def test_a_wrong_file_is_one_line(pem: Path, certificate: str, key: str, client_ca: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        server_context(str(pem / certificate), str(pem / key), str(pem / client_ca) if client_ca else "")
    assert "\n" not in str(caught.value)
