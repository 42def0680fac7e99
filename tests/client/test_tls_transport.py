"""`tls://`: who is served, and one line for everything that can be wrong with a handshake.

The stand-in's TLS is OpenSSL's; the service's own, with its event loop, is in `tests/service/test_secured_service.py`.
"""

import socket
import ssl
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from certificates import make_certificates
from fake_service import EYE, FakeService, Q, TcpFake

from ik_client import IKClient, ServiceTimeout, ServiceUnavailable
from ik_proto import encode_frame

TOKEN = "a-secret-of-the-test"


@pytest.fixture(scope="module")
def pem(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_certificates(tmp_path_factory.mktemp("pem"))


@pytest.fixture
def secured(pem: Path, service: FakeService, start_tcp: Callable[..., TcpFake]) -> Callable[..., TcpFake]:
    """Start a stand-in with one of the certificates, asking for those of an authority or for none."""

    def start(name: str = "service", client_ca: str = "", newest: ssl.TLSVersion = ssl.TLSVersion.TLSv1_3) -> TcpFake:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(pem / f"{name}.pem", pem / f"{name}.key")
        context.maximum_version = newest
        if client_ca:
            context.load_verify_locations(pem / client_ca)
            context.verify_mode = ssl.CERT_REQUIRED
        return start_tcp(service, tls=context)

    return start


def fault(url: str, **arguments: object) -> str:
    """The one line of a client that cannot connect, without the address in front."""
    with pytest.raises(ServiceUnavailable) as caught:
        IKClient(url, connect_timeout=0.1, **arguments)  # ty: ignore[invalid-argument-type]
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(f"{url}: ")
    return text.removeprefix(f"{url}: ")


def test_a_service_whose_certificate_is_good_is_used(secured, service, pem):
    fake = secured()
    for host in ("127.0.0.1", "localhost"):
        with IKClient(f"tls://{host}:{fake.port}", timeout=2.0, ca=pem / "ca.pem", token=TOKEN) as ik:
            assert ik.solve(EYE, EYE, Q).success
    assert [document.get("token") for document in service.documents] == 2 * [TOKEN, None, None]


def test_a_connection_is_kept_and_a_broken_one_replaced(secured, service, pem):
    """Hazard row: lost connection."""
    fake = secured()
    with IKClient(fake.url, timeout=2.0, ca=pem / "ca.pem") as ik:
        ik.solve(EYE, EYE, Q)
        assert fake.accepted == 1
        service.answer = lambda request: None
        with pytest.raises(ServiceUnavailable, match="closes the connection without an answer"):
            ik.solve(EYE, EYE, Q)
        service.answer = service.reply
        assert ik.solve(EYE, EYE, Q).success


@pytest.mark.parametrize("ca", ["stranger_ca.pem", None])
def test_an_unknown_authority(secured, pem, ca):
    assert "its certificate is not trusted" in fault(secured().url, ca=ca and pem / ca)


def test_a_certificate_for_another_host(secured, pem):
    fake = secured("elsewhere")
    assert "its certificate is not for 127.0.0.1" in fault(fake.url, ca=pem / "ca.pem")
    assert "its certificate is not for localhost" in fault(f"tls://localhost:{fake.port}", ca=pem / "ca.pem")


def test_an_expired_certificate(secured, pem):
    assert "its certificate has expired" in fault(secured("expired").url, ca=pem / "ca.pem")


def test_a_service_that_speaks_tls_to_a_client_that_does_not(secured):
    fake = secured()
    assert "write tls://" in fault(f"tcp://127.0.0.1:{fake.port}", token=TOKEN)


def test_an_alert_is_recognised(service, start_tcp):
    service.frame = lambda body: b"\x15\x03\x01\x00\x02\x02\x46"  # fatal: protocol version
    fake = start_tcp(service)
    assert fault(fake.url) == f"it speaks TLS; write tls://127.0.0.1:{fake.port}"


@pytest.mark.parametrize("newest", [ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3])
def test_client_certificates(secured, pem, newest):
    """Hazard row: auth. Where a service's objection comes depends on the version of TLS."""
    fake = secured(client_ca="ca.pem", newest=newest)
    ca = pem / "ca.pem"
    with IKClient(fake.url, timeout=2.0, ca=ca, cert=pem / "client.pem", key=pem / "client.key") as ik:
        assert ik.solve(EYE, EYE, Q).success
    for own in ({}, {"cert": pem / "stranger.pem", "key": pem / "stranger.key"}):
        assert "as cert, with its key" in fault(fake.url, ca=ca, **own)


def test_versions_before_1_2_are_not_spoken(secured, pem):
    with pytest.warns(DeprecationWarning, match="TLSv1_1"):
        fake = secured(newest=ssl.TLSVersion.TLSv1_1)
    fault(fake.url, ca=pem / "ca.pem")


def test_a_handshake_that_does_not_come_about_costs_the_timeout_and_no_more(pem, free_port):
    with (
        socket.create_server(("127.0.0.1", free_port)),  # accepts in the kernel, never answers
        IKClient(f"tls://127.0.0.1:{free_port}", timeout=0.05, ca=pem / "ca.pem", connect=False) as ik,
        pytest.raises(ServiceTimeout),
    ):
        ik.solve(EYE, EYE, Q)


@pytest.mark.parametrize(
    ("said", "words"),
    [(b"", "closes the connection"), (encode_frame(b'{"status": "bad_request"}'), "does not speak TLS; write tcp://")],
)
def test_a_service_that_says_something_else_or_hangs_up(pem, said, words):
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.recv(1000)  # the whole greeting: closing on what is unread would reset the connection
                connection.sendall(said)

        thread = threading.Thread(target=answer)
        thread.start()
        url = f"tls://127.0.0.1:{listener.getsockname()[1]}"
        with (
            IKClient(url, timeout=5.0, ca=pem / "ca.pem", connect=False) as ik,
            pytest.raises(ServiceUnavailable, match=words),
        ):
            ik.solve(EYE, EYE, Q)
        thread.join()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"ca": "service.key"}, "holds no PEM certificate"),
        ({"ca": "nowhere.pem"}, "cannot be read"),
        ({"cert": "client.pem", "key": "stranger.key"}, "do not belong together"),
        ({"cert": "client.pem"}, "no PEM certificate and key"),
        ({"cert": "nowhere.pem"}, "cannot be read"),
    ],
)
def test_a_wrong_file_is_one_line_before_anything_is_sent(pem, arguments, words):
    with pytest.raises(ValueError, match=words) as caught:
        IKClient("tls://127.0.0.1:1", connect=False, **{name: pem / file for name, file in arguments.items()})
    assert "\n" not in str(caught.value)
