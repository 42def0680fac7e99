"""Certificates: as OpenSSL, which headsets' browsers agree with, and cryptography's own verifier see them."""

import datetime
import ssl
import stat
from ipaddress import ip_address
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec

from xr_client import addresses
from xr_client.certificates import CA_DAYS, LEAF_DAYS, certificate_fault, ensure_credentials
from xr_client.key_files import CertificateError, load_certificate, load_key, new_key, pem_of

NOW = datetime.datetime.now(datetime.UTC)
NAMES = ["192.168.1.20", "robot.local", "robot"]


def days(number: float) -> datetime.timedelta:
    return datetime.timedelta(days=number)


@pytest.fixture
def folder(tmp_path) -> Path:
    return tmp_path / "xr"


def make(folder, names=NAMES, now=NOW, hosts=("robot",)):
    return ensure_credentials(folder, names, hosts, now)


def handshake(leaf: Path, key: Path, ca: Path, host: str) -> None:
    """A TLS handshake in memory, the client checking certificate and host as browsers do; raises where it refuses."""
    server_context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server_context.load_cert_chain(leaf, key)
    client_context = ssl.create_default_context(cafile=ca)
    to_client, to_server = ssl.MemoryBIO(), ssl.MemoryBIO()
    client = client_context.wrap_bio(to_client, to_server, server_hostname=host)
    server = server_context.wrap_bio(to_server, to_client, server_side=True)
    for _ in range(4):
        for side in (client, server):
            try:
                side.do_handshake()
            except ssl.SSLWantReadError:
                continue
    assert client.version() == "TLSv1.3"


@pytest.mark.parametrize("host", ["192.168.1.20", "robot.local", "robot", "localhost", "127.0.0.1"])
def test_a_client_that_trusts_the_ca_is_satisfied(folder, host):
    made = make(folder)
    handshake(made.leaf, made.key, made.ca, host)


@pytest.mark.parametrize("host", ["fd12:3456::7", "::1"])
def test_a_client_that_comes_by_ipv6_is_too(folder, host):
    made = make(folder, names=["fd12:3456::7"])
    handshake(made.leaf, made.key, made.ca, host)


@pytest.mark.parametrize("host", ["192.168.1.21", "elsewhere.local", "example.com"])
def test_a_client_under_another_name_is_not(folder, host):
    made = make(folder)
    with pytest.raises(ssl.SSLCertVerificationError, match="match"):
        handshake(made.leaf, made.key, made.ca, host)


def test_a_client_without_the_ca_is_not(folder, tmp_path):
    made, other = make(folder), make(tmp_path / "other")
    with pytest.raises(ssl.SSLCertVerificationError, match="verify failed"):
        handshake(made.leaf, made.key, other.ca, "robot.local")


@pytest.mark.parametrize("host", ["example.com", "8.8.8.8", "2001:db8::1"])
def test_a_stolen_ca_key_speaks_for_no_site_in_the_internet(folder, tmp_path, host):
    """The name constraints: a leaf signed with the very key is refused for what lies outside of them."""
    made = make(folder)
    ca, ca_key, key = load_certificate(made.ca), load_key(folder / "ca.key"), new_key(tmp_path / "evil.key")
    evil = forged(ca, ca_key, key, host)
    (tmp_path / "evil.pem").write_bytes(pem_of(evil) + pem_of(ca))
    with pytest.raises(ssl.SSLCertVerificationError, match="permitted subtree"):
        handshake(tmp_path / "evil.pem", tmp_path / "evil.key", made.ca, host)


@pytest.mark.parametrize("host", ["robot.local", "10.1.2.3"])
def test_the_forgery_above_would_work_within_them(folder, tmp_path, host):
    """Negative control."""
    made = make(folder)
    ca, ca_key, key = load_certificate(made.ca), load_key(folder / "ca.key"), new_key(tmp_path / "evil.key")
    (tmp_path / "evil.pem").write_bytes(pem_of(forged(ca, ca_key, key, host)) + pem_of(ca))
    handshake(tmp_path / "evil.pem", tmp_path / "evil.key", made.ca, host)


def forged(ca: x509.Certificate, ca_key: ec.EllipticCurvePrivateKey, key, host: str) -> x509.Certificate:
    name = x509.IPAddress(ip_address(host)) if host[0].isdigit() else x509.DNSName(host)
    return (
        x509.CertificateBuilder()
        .subject_name(x509.Name([]))
        .issuer_name(ca.subject)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(NOW - days(1))
        .not_valid_after(NOW + days(1))
        .add_extension(x509.SubjectAlternativeName([name]), critical=True)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(ca_key.public_key()), critical=False)
        .sign(ca_key, hashes.SHA256())
    )


def test_forms(folder):
    """What devices insist on: lifetimes, a critical CA flag without further CAs, server use, the SubjectAltName."""
    made = make(folder)
    ca, leaf = load_certificate(made.ca), load_certificate(made.leaf)
    basic = ca.extensions.get_extension_for_class(x509.BasicConstraints)
    assert (basic.critical, basic.value.ca, basic.value.path_length) == (True, True, 0)
    assert ca.extensions.get_extension_for_class(x509.NameConstraints).critical
    assert ca.not_valid_after_utc - ca.not_valid_before_utc <= days(CA_DAYS + 1)
    assert leaf.not_valid_after_utc - leaf.not_valid_before_utc <= days(LEAF_DAYS) <= days(825)
    assert not leaf.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert made.ca_der == ssl.PEM_cert_to_DER_cert(made.ca.read_text())


def test_keys_are_private(folder):
    make(folder)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    for key in ("ca.key", "leaf.key"):
        assert stat.S_IMODE((folder / key).stat().st_mode) == 0o600


@pytest.mark.parametrize(
    ("path", "mode", "words"), [("ca.key", 0o640, "read by others"), (".", 0o770, "written by others")]
)
def test_what_others_can_reach_is_refused(folder, path, mode, words):
    make(folder)
    (folder / path).chmod(mode)
    with pytest.raises(CertificateError, match=f"{words}.*chmod"):
        make(folder)


def test_what_is_good_stays(folder):
    before = make(folder).leaf.read_bytes()
    again = make(folder, now=NOW + days(100))
    assert not again.renewed
    assert again.leaf.read_bytes() == before


@pytest.mark.parametrize(
    ("change", "renewed"),
    [
        ({"now": NOW + days(LEAF_DAYS - 31)}, False),
        ({"now": NOW + days(LEAF_DAYS - 29)}, True),
        ({"now": NOW - days(1)}, True),
        ({"names": ["10.0.0.7"]}, True),
        ({"names": NAMES[:1]}, False),
    ],
    ids=["before it is due", "when it is due", "not valid yet", "another address", "fewer addresses"],
)
def test_a_leaf_is_renewed_when_it_is_due_or_for_other_addresses(folder, change, renewed):
    first = make(folder)
    ca = first.ca.read_bytes()
    second = make(folder, **change)
    assert second.renewed is renewed
    assert second.ca.read_bytes() == ca
    names = change.get("names", NAMES)
    assert certificate_fault(second.leaf, names[0], change.get("now", NOW)) is None


def test_a_leaf_ends_with_its_ca_and_is_then_kept(folder):
    make(folder)
    late = NOW + days(CA_DAYS - 10)
    assert make(folder, now=late).renewed
    assert not make(folder, now=late + days(1)).renewed
    with pytest.raises(CertificateError, match=r"authority expired.*start again"):
        make(folder, now=NOW + days(CA_DAYS + 1))


@pytest.mark.parametrize("name", ["ca.pem", "ca.key", "leaf.key"])
def test_damaged_files_are_told(folder, name):
    make(folder)
    (folder / name).write_text("nonsense")
    with pytest.raises(CertificateError, match=f"{name} is no readable"):
        make(folder)


def test_a_leaf_of_another_ca_is_replaced(folder, tmp_path):
    make(folder)
    other = make(tmp_path / "other")
    for name in ("leaf.pem", "leaf.key"):
        (folder / name).write_bytes((tmp_path / "other" / name).read_bytes())
    assert other.renewed
    made = make(folder)
    assert made.renewed
    handshake(made.leaf, made.key, made.ca, "robot.local")


def test_a_ca_with_the_key_of_another_is_told(folder, tmp_path):
    make(folder)
    make(tmp_path / "other")
    (folder / "ca.key").write_bytes((tmp_path / "other" / "ca.key").read_bytes())
    with pytest.raises(CertificateError, match="do not belong together"):
        make(folder)


def test_names_beyond_the_constraints_are_left_out(folder):
    made = make(folder, names=["8.8.8.8", "pc.example.com", "2001:db8::1", "192.168.1.20", "robot.example.com"])
    with pytest.raises(ssl.SSLCertVerificationError, match="match"):
        handshake(made.leaf, made.key, made.ca, "pc.example.com")
    handshake(made.leaf, made.key, made.ca, "192.168.1.20")


@pytest.mark.parametrize(
    ("host", "later", "words"),
    [
        ("robot.local", 0, None),
        ("ROBOT.local", 0, None),
        ("192.168.1.20", 0, None),
        ("192.168.1.99", 0, "is for localhost, 127.0.0.1, ::1, 192.168.1.20, robot.local, robot, not for 192.168.1.99"),
        ("robot.local", LEAF_DAYS + 1, "expired on"),
        ("robot.local", -1, "valid only from"),
    ],
)
def test_what_is_wrong_with_a_certificate_is_said_in_words(folder, host, later, words):
    fault = certificate_fault(make(folder).leaf, host, NOW + days(later))
    assert fault is None if words is None else words in str(fault)


def test_local_addresses_are_private_ones():
    found = addresses.local_addresses(ipv6=True)
    assert len(found) == len(set(found))
    assert all(address.is_private and not address.is_loopback for address in found)
    plain = addresses.local_addresses()
    assert plain == [address for address in found if address.version == 4]


def test_ipv6_addresses_of_this_site_only(tmp_path, monkeypatch):
    """As Linux lists them: link-local, loopback, unique local, global."""
    table = tmp_path / "if_inet6"
    rows = ("fe80" + "0" * 27 + "1", "0" * 31 + "1", "fd12" + "0" * 27 + "7", "20010db8" + "0" * 23 + "1")
    table.write_text("".join(f"{row} 02 40 00 80     eth0\n" for row in rows))
    monkeypatch.setattr(addresses, "_IPV6_INTERFACES", table)
    assert [str(one) for one in addresses.local_addresses(ipv6=True) if one.version == 6] == ["fd12::7"]
    monkeypatch.setattr(addresses, "_IPV6_INTERFACES", tmp_path / "absent")
    assert all(one.version == 4 for one in addresses.local_addresses(ipv6=True))


@pytest.mark.parametrize(
    ("name", "names"),
    [("Robot", ["robot.local", "robot"]), ("pc.lab.example", ["pc.local", "pc.lab.example"]), ("localhost", [])],
)
def test_host_names(monkeypatch, name, names):
    monkeypatch.setattr(addresses.socket, "gethostname", lambda: name)
    assert addresses.host_names() == names


def test_the_token_is_in_the_part_of_the_url_that_is_not_sent():
    assert addresses.page_url("10.0.0.5", 8443, "abc", secure=True) == "https://10.0.0.5:8443/#abc"
    assert addresses.page_url("localhost", 8080, "abc", secure=False).startswith("http://localhost:8080/#")
    assert addresses.page_url("fd12::7", 8443, "abc", secure=True) == "https://[fd12::7]:8443/#abc"
    assert addresses.page_url("localhost", 1, "abc", secure=False, path="/emulate") == "http://localhost:1/emulate#abc"


def test_the_qr_code_is_readable_text():
    """As wide as it is high, two rows a line; reading one back needs a camera."""
    code = addresses.qr_code("https://192.168.1.20:8443/#0123456789abcdef0123456789abcdef")
    assert len(code.splitlines()) in range(17, 30)


def test_the_way_over_usb():
    route = addresses.usb_route("http://localhost:8080/#abc", 8080)
    assert "adb reverse tcp:8080 tcp:8080, then open http://localhost:8080/#abc" in route
