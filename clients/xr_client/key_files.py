"""Keys and certificates as files: keys 0600 from the first byte, and refused where others can read them."""

import os
import stat
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec


class CertificateError(ValueError):
    """Certificates cannot be made or used; the message says why and what to do, in one line."""


def new_key(path: Path) -> ec.EllipticCurvePrivateKey:
    """Make a key on P-256 and keep it in a file of mode 0600.

    Args:
        path: The PEM file; replaced where it exists.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    none = serialization.NoEncryption()
    write_file(path, key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, none), 0o600)
    return key


def load_key(path: Path) -> ec.EllipticCurvePrivateKey:
    """Read a key.

    Args:
        path: The PEM file.

    Raises:
        CertificateError: It is no readable key on an elliptic curve, or others can read it.
    """
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        key = serialization.load_pem_private_key(path.read_bytes(), None)
    except (OSError, TypeError, ValueError):
        key = None
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise CertificateError(f"{path} is no readable key: remove the folder {path.parent} and start again")
    if mode & 0o077:
        raise CertificateError(f"{path} can be read by others (mode {mode:04o}): chmod 600 it")
    return key


def load_certificate(path: Path) -> x509.Certificate:
    """Read the first certificate of a file.

    Args:
        path: The PEM file.

    Raises:
        CertificateError: It holds none.
    """
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except (OSError, ValueError):
        raise CertificateError(f"{path} is no readable certificate in PEM form") from None


def pem_of(certificate: x509.Certificate) -> bytes:
    """A certificate in PEM form."""
    return certificate.public_bytes(serialization.Encoding.PEM)


def write_file(path: Path, data: bytes, mode: int) -> None:
    """Write a file as a whole or not at all, never readable by more people than it will be.

    Args:
        path: The file; replaced where it exists.
        data: Its content.
        mode: Its permissions.
    """
    new = path.with_name(path.name + ".new")
    new.unlink(missing_ok=True)
    with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
        file.write(data)
    new.replace(path)


def require_only_owner_writes(folder: Path) -> None:
    """Refuse a folder that others can write to.

    Args:
        folder: The folder.

    Raises:
        CertificateError: They can.
    """
    mode = stat.S_IMODE(folder.stat().st_mode)
    if mode & 0o022:
        raise CertificateError(f"{folder} can be written by others (mode {mode:04o}): chmod 700 it")
