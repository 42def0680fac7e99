"""HTTPS without a public name: a private certificate authority (CA), and a certificate for where this machine is now.

A headset that installs the CA trusts it from then on. So that this gives away as little as possible:

- The CA is name-constrained: headsets accept it for private networks, `localhost`, `.local` and this machine's own name
  at the time it was made, and for nothing else, whoever gets hold of its key.
- Its key never leaves the folder, which is 0700; keys are 0600. A key that others can read is refused.
- The leaf lasts 397 days (Apple accepts 825 at most). It is renewed 30 days before it ends, and when the machine's
  addresses are no longer those it names; while a server runs, `renewal` does that.

| file       | what                                                                 |
|------------|----------------------------------------------------------------------|
| `ca.pem`   | the CA's certificate, 10 years: to be installed in the headset       |
| `ca.key`   | its key                                                              |
| `leaf.pem` | the server's certificate, followed by the CA's                       |
| `leaf.key` | its key                                                              |

P-256 throughout; needs the package cryptography.
"""

import datetime
import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from xr_client.addresses import PERMITTED_NETWORKS
from xr_client.key_files import (
    CertificateError,
    load_certificate,
    load_key,
    new_key,
    pem_of,
    require_only_owner_writes,
    write_file,
)

CA_DAYS = 3650
LEAF_DAYS = 397
RENEW_DAYS = 30

_EARLY = datetime.timedelta(hours=1)
"""Certificates begin this much in the past, for headsets whose clock is late."""


@dataclass(frozen=True, slots=True)
class Credentials:
    """What a server needs.

    Attributes:
        leaf: PEM file of its certificate and the CA's.
        key: PEM file of its key.
        ca: PEM file of the CA's certificate.
        renewed: Whether the leaf was made just now.
    """

    leaf: Path
    key: Path
    ca: Path
    renewed: bool

    @property
    def ca_der(self) -> bytes:
        """The CA's certificate in the form that headsets install."""
        return load_certificate(self.ca).public_bytes(serialization.Encoding.DER)


def ensure_credentials(folder: Path, names: Sequence[str], hosts: Sequence[str], now: datetime.datetime) -> Credentials:
    """Make what is missing, renew what is due, keep the rest.

    Args:
        folder: Where certificates and keys are kept; made where it is absent.
        names: Addresses and names the leaf shall be for, the most important first. Those beyond the CA's constraints
            are left out.
        hosts: Names of this machine that a new CA shall speak for, beside `localhost` and `.local`.
        now: The time, with a time zone.

    Returns:
        The files.

    Raises:
        CertificateError: The folder or a key in it is open to others, a file is damaged, or the CA has expired.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    require_only_owner_writes(folder)
    ca_path, ca_key_path = folder / "ca.pem", folder / "ca.key"
    if not ca_path.exists():
        key = new_key(ca_key_path)
        write_file(ca_path, pem_of(_make_ca(key, hosts, now)), 0o644)
    ca, ca_key = load_certificate(ca_path), load_key(ca_key_path)
    again = f"remove {folder}, start again, and install the new one in the headset"
    if ca.public_key() != ca_key.public_key():
        raise CertificateError(f"{ca_path} and {ca_key_path} do not belong together: {again}")
    if now >= ca.not_valid_after_utc:
        raise CertificateError(f"the certificate authority expired on {ca.not_valid_after_utc:%Y-%m-%d}: {again}")
    files = folder / "leaf.pem", folder / "leaf.key"
    wanted = _alternative_names(names, ca)
    if _still_good(*files, ca, wanted, now):
        return Credentials(*files, ca_path, renewed=False)
    leaf = _make_leaf(new_key(files[1]), ca, ca_key, wanted, now)
    write_file(files[0], pem_of(leaf) + pem_of(ca), 0o644)
    return Credentials(*files, ca_path, renewed=True)


def certificate_fault(pem: Path, host: str, now: datetime.datetime) -> str | None:
    """Say in words why a headset would refuse a server's certificate.

    Args:
        pem: The certificate, first in the file.
        host: Address or name in the page's URL.
        now: The time, with a time zone.

    Returns:
        One line; None where neither its time nor its names are at fault.

    Raises:
        CertificateError: The file holds no certificate.
    """
    leaf = load_certificate(pem)
    if now >= leaf.not_valid_after_utc:
        return f"the certificate {pem} expired on {leaf.not_valid_after_utc:%Y-%m-%d %H:%M} UTC: renew it"
    if now < leaf.not_valid_before_utc:
        return f"the certificate {pem} is valid only from {leaf.not_valid_before_utc:%Y-%m-%d %H:%M} UTC: set the clock"
    names = _names_of(leaf)
    if _name(host) not in names:
        known = ", ".join(str(name.value) for name in names) or "nothing"
        return (
            f"the certificate {pem} is for {known}, not for {host}: open one of those, or remove {pem.parent} and "
            f"start with --name {host}"
        )
    return None


def _make_ca(key: ec.EllipticCurvePrivateKey, hosts: Sequence[str], now: datetime.datetime) -> x509.Certificate:
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "ik-xr private CA")])
    names = ["localhost", "local", *(host for host in hosts if not host.endswith(".local"))]
    permitted = [x509.DNSName(name) for name in names] + [x509.IPAddress(network) for network in PERMITTED_NETWORKS]
    usage = x509.KeyUsage(False, False, False, False, False, True, True, False, False)
    return (
        _builder(subject, subject, key, now, now + datetime.timedelta(days=CA_DAYS))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.NameConstraints(permitted, None), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )


def _make_leaf(
    key: ec.EllipticCurvePrivateKey,
    ca: x509.Certificate,
    ca_key: ec.EllipticCurvePrivateKey,
    names: list[x509.GeneralName],
    now: datetime.datetime,
) -> x509.Certificate:
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "ik-xr")])
    end = min(now + datetime.timedelta(days=LEAF_DAYS) - _EARLY, ca.not_valid_after_utc)
    usage = x509.KeyUsage(True, False, False, False, False, False, False, False, False)
    authority = ca.extensions.get_extension_for_class(x509.SubjectKeyIdentifier).value
    return (
        _builder(subject, ca.subject, key, now, end)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(authority), critical=False)
        .sign(ca_key, hashes.SHA256())
    )


def _builder(
    subject: x509.Name,
    issuer: x509.Name,
    key: ec.EllipticCurvePrivateKey,
    now: datetime.datetime,
    end: datetime.datetime,
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _EARLY)
        .not_valid_after(end)
    )


def _still_good(
    pem: Path, key_path: Path, ca: x509.Certificate, wanted: list[x509.GeneralName], now: datetime.datetime
) -> bool:
    """Whether a leaf can stay: of this CA, with its key, for all these names, and for some time."""
    if not (pem.exists() and key_path.exists()):
        return False
    leaf = load_certificate(pem)
    try:
        leaf.verify_directly_issued_by(ca)
    except Exception:  # whatever is wrong with its signature or issuer, a new one is made
        return False
    end, end_of_ca = leaf.not_valid_after_utc, ca.not_valid_after_utc
    due = end - datetime.timedelta(days=RENEW_DAYS) if end < end_of_ca else end
    in_time = leaf.not_valid_before_utc <= now < due
    own_key = leaf.public_key() == load_key(key_path).public_key()
    return in_time and own_key and set(wanted) <= set(_names_of(leaf))


def _alternative_names(names: Sequence[str], ca: x509.Certificate) -> list[x509.GeneralName]:
    """The names a leaf may have, in order: those within the CA's constraints."""
    permitted = ca.extensions.get_extension_for_class(x509.NameConstraints).value.permitted_subtrees or ()
    domains = [name.value for name in permitted if isinstance(name, x509.DNSName)]
    networks = [ipaddress.ip_network(str(name.value)) for name in permitted if isinstance(name, x509.IPAddress)]
    result = []
    for name in map(_name, dict.fromkeys(["localhost", "127.0.0.1", "::1", *names])):
        if isinstance(name, x509.IPAddress):
            within = any(ipaddress.ip_address(str(name.value)) in network for network in networks)
        else:
            within = any(name.value == domain or name.value.endswith("." + domain) for domain in domains)
        if within:
            result.append(name)
    return result


def _name(text: str) -> x509.IPAddress | x509.DNSName:
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        return x509.DNSName(text.lower())


def _names_of(leaf: x509.Certificate) -> list[x509.GeneralName]:
    try:
        return list(leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value)
    except x509.ExtensionNotFound:
        return []
