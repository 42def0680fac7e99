"""TLS of the TCP endpoint: a certificate of our own, and, where wished, one demanded of every client."""

import ssl

from ik_service.config import ConfigError


class _Encrypted(Exception):
    """The private key is protected by a passphrase."""


def server_context(certificate: str, key: str, client_ca: str = "") -> ssl.SSLContext:
    """Read what TLS needs.

    Args:
        certificate: PEM file with the service's certificate, and after it those between it and the authority's.
        key: PEM file with its private key.
        client_ca: PEM file with the authorities whose clients are served; empty serves clients without a certificate.

    Returns:
        A context for TLS 1.2 and newer.

    Raises:
        ConfigError: A file cannot be read, or the key is not that of the certificate.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        _must_be_readable(certificate, key)
        context.load_cert_chain(certificate, key, password=_no_passphrase)
    except _Encrypted:
        raise ConfigError(f"--tls-key {key} is protected by a passphrase, and nobody is there to type it") from None
    except ssl.SSLError as error:
        fault = "do not belong together" if error.reason == "KEY_VALUES_MISMATCH" else "are no PEM certificate and key"
        raise ConfigError(f"--tls-cert {certificate} and --tls-key {key} {fault}") from None
    if client_ca:
        try:
            _must_be_readable(client_ca)
            context.load_verify_locations(client_ca)
        except ssl.SSLError:
            raise ConfigError(f"--tls-client-ca {client_ca} holds no PEM certificate") from None
        context.verify_mode = ssl.CERT_REQUIRED
    return context


def _no_passphrase() -> str:
    """Instead of OpenSSL's question on the terminal."""
    raise _Encrypted


def _must_be_readable(*files: str) -> None:
    """OpenSSL's errors do not name the file."""
    for file in files:
        try:
            open(file, "rb").close()
        except OSError as error:
            raise ConfigError(f"{file}: cannot be read ({error.strerror})") from None
