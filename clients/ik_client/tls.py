"""TLS towards a service: whom to trust, what to show, and what to say of a handshake that fails.

The service's certificate is always checked against its host name or address; there is no way to leave that out.
"""

import ssl

from ik_client.access import Access

_CLIENT_CERTIFICATE_ALERTS = (
    "ALERT_CERTIFICATE_REQUIRED",
    "ALERT_UNKNOWN_CA",
    "ALERT_BAD_CERTIFICATE",
    "ALERT_CERTIFICATE_EXPIRED",
    "ALERT_HANDSHAKE_FAILURE",
)
"""What a service sends, at the end of OpenSSL's names for it, that does not like the client's certificate."""

_NO_TLS = ("WRONG_VERSION_NUMBER", "RECORD_LAYER_FAILURE", "UNEXPECTED_MESSAGE")


class _Encrypted(Exception):
    """The private key is protected by a passphrase."""


def client_context(access: Access) -> ssl.SSLContext:
    """Read the certificates.

    Args:
        access: The client's credentials.

    Returns:
        A context for TLS 1.2 and newer that checks the service's certificate and name.

    Raises:
        ValueError: A file cannot be read, or holds something else; one line that names it.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # checks name and certificate
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        if access.ca:
            context.load_verify_locations(access.ca)
        else:
            context.load_default_certs()
    except ssl.SSLError:
        raise ValueError(f"ca {access.ca} holds no PEM certificate") from None
    except OSError as error:
        raise ValueError(f"ca {access.ca} cannot be read ({error.strerror})") from None
    if access.cert:
        _load_own(context, access.cert, access.key)
    return context


def _load_own(context: ssl.SSLContext, cert: str, key: str) -> None:
    def no_passphrase() -> str:  # instead of OpenSSL's question on the terminal
        raise _Encrypted

    files = f"cert {cert}" + (f" and key {key}" if key else "")
    try:
        context.load_cert_chain(cert, key or None, password=no_passphrase)
    except _Encrypted:
        raise ValueError(f"key {key or cert} is protected by a passphrase; take one that is not") from None
    except ssl.SSLError as error:
        fault = "do not belong together" if error.reason == "KEY_VALUES_MISMATCH" else "are no PEM certificate and key"
        raise ValueError(f"{files} {fault}") from None
    except OSError as error:
        raise ValueError(f"{files} cannot be read ({error.strerror})") from None


def fault_of(error: ssl.SSLError, host: str) -> str:
    """Say what is wrong and what to do.

    Args:
        error: What OpenSSL reports.
        host: Whom the client wanted to talk to.

    Returns:
        A line without the address in front.
    """
    if isinstance(error, ssl.SSLCertVerificationError):
        match error.verify_code:  # OpenSSL's numbers, X509_V_ERR_*
            case 10:
                return "its certificate has expired; renew it there"
            case 9:
                return "its certificate is not valid yet; look at the clocks of both machines"
            case 62 | 64:
                return f"its certificate is not for {host}; use the name that it is for, or make one for this"
            case _:
                return f"its certificate is not trusted ({error.verify_message}); pass the PEM of its authority as ca"
    reason = error.reason or ""
    if reason.endswith(_CLIENT_CERTIFICATE_ALERTS):
        return "it does not accept this client's certificate; pass one of its authority as cert, with its key"
    if reason in _NO_TLS:
        return "it does not speak TLS; write tcp:// to talk to it without"
    return f"TLS fails ({reason.lower().replace('_', ' ') or 'no reason given'})"
