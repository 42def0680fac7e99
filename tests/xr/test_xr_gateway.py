"""The way to the page: certificates, addresses and sockets of a whole session, and the words for it."""

import socket
import ssl
import threading
import time
from dataclasses import replace
from ipaddress import IPv4Address
from typing import Any

import pytest
from cryptography import x509
from xr_browser import browse
from xr_samples import at, controller, packet

from xr_client import gateway, network, renewal
from xr_client.gateway import open_gateway
from xr_client.hud_board import HudBoard
from xr_client.key_files import CertificateError
from xr_client.packets import encode_packet
from xr_client.settings import Settings
from xr_client.stages import Stages
from xr_client.tracker import Tracker

LIMIT = 20.0


def settings(folder, **others: Any) -> Settings:
    return replace(
        Settings(host="127.0.0.1", port=0, local_port=0, names=("127.0.0.1",), certificates=folder / "certificates"),
        **others,
    )


def opened(options: Settings, tracker: Tracker | None = None, stages: Stages | None = None, **others: Any) -> Any:
    stages = stages or Stages()
    return open_gateway(options, tracker or Tracker(), HudBoard(stages), stages, **others)


def send_poses(url: str, context: ssl.SSLContext | None) -> dict[str, Any]:
    """Send some packets from the page's own origin; gives the first HUD that comes back."""
    origin, token = url.split("/#")

    async def work(http: Any) -> dict[str, Any]:
        query, headers = {"token": token}, {"Origin": origin}
        async with http.ws_connect(f"{origin}/pose", params=query, headers=headers, ssl=context or True) as socket:
            while True:
                said = await socket.receive_json()
                if said["type"] == "hud":
                    break
                await socket.send_json({"type": "pong", "t_ms": said["t_ms"], "page_ms": 1e3 * time.monotonic()})
            for seq in range(3):
                capture_ms = 1e3 * time.monotonic()
                await socket.send_bytes(encode_packet(packet(seq, left=controller(at()), capture_ms=capture_ms)))
            await socket.send_json({"type": "clear"})
            return said

    return browse(work)


def test_a_headset_finds_its_way_over_the_network(tmp_path):
    tracker, stages, cleared = Tracker(), Stages(), threading.Event()
    with opened(settings(tmp_path), tracker, stages, clear=cleared.set) as way:
        context = ssl.create_default_context(cafile=tmp_path / "certificates" / "ca.pem")
        assert way.pages[0].startswith("https://127.0.0.1:")
        said = send_poses(way.pages[0], context)
        assert list(said["latency_ms"]) == ["headset", "wait", "service", "command", "video", "solve"]
        assert tracker.connections == 1
        assert cleared.wait(LIMIT)  # so the packets before are there
        taken = stages["headset"].summary()
        assert taken is not None
        assert taken.n == 3
        assert 0.0 <= taken.max < 1e3 * LIMIT
        lines = list(way.describe(with_qr_code=True))
        assert way.pages[0] in lines[0]
        assert any(way.install in line and "#" not in way.install for line in lines)
        assert any("adb reverse" in line for line in lines)
        assert any("█" in line for line in lines)


def test_on_this_machine_it_takes_no_certificate(tmp_path):
    tracker = Tracker()
    with opened(settings(tmp_path, local_only=True), tracker) as way:
        assert (way.pages, way.install) == ((), "")
        local = way.local.replace("localhost", "127.0.0.1")
        send_poses(local, None)
        assert tracker.connections == 1
        assert way.local in "".join(way.describe(with_qr_code=True))
    assert not (tmp_path / "certificates").exists()


def test_every_run_has_its_own_token(tmp_path):
    tokens = set()
    for _ in range(3):
        with opened(settings(tmp_path, local_only=True)) as way:
            tokens.add(way.local.split("#")[1])
    assert len(tokens) == 3
    assert min(map(len, tokens)) >= 22


def test_certificates_that_cannot_be_used_open_nothing(tmp_path, monkeypatch):
    with opened(settings(tmp_path)):
        pass
    (tmp_path / "certificates" / "ca.key").chmod(0o644)
    monkeypatch.setattr(gateway, "XrServer", None)
    with pytest.raises(CertificateError, match="read by others"), opened(settings(tmp_path)):
        pass


def test_the_emulated_headset_has_a_page_of_its_own(tmp_path, monkeypatch):
    script = tmp_path / "iwer.js"
    script.write_text("export const emulated = true;")
    monkeypatch.setattr(gateway, "iwer_script", lambda: script)
    with opened(settings(tmp_path, local_only=True, emulate=True)) as way:
        address, token = way.emulator.split("#")
        assert address == f"http://localhost:{way.local_port}/emulate"
        assert way.local.endswith(f"#{token}")
        assert way.emulator in "".join(way.describe(with_qr_code=False))
    with opened(settings(tmp_path, local_only=True)) as way:
        assert way.emulator == ""


def test_a_name_the_authority_does_not_speak_for_is_not_offered(tmp_path):
    with opened(settings(tmp_path)) as way:
        assert all("example.com" not in url for url in way.pages)
    with opened(settings(tmp_path, names=("robot.example.com", "127.0.0.1"))) as way:
        assert way.pages[0].startswith("https://127.0.0.1:")
        assert any("not for robot.example.com" in fault for fault in way.faults)
        assert set(way.faults) < set(way.describe(with_qr_code=False))
    # Said at the first start, when the authority is made, it is.
    with opened(settings(tmp_path / "new", names=("robot.example.com",))) as way:
        assert way.pages[0].startswith("https://robot.example.com:")
        assert way.faults == ()


@pytest.fixture
def other_address(monkeypatch) -> list[IPv4Address]:
    """Addresses of this machine, to be changed; looked at a hundred times a second."""
    addresses = [IPv4Address("192.168.1.20")]
    monkeypatch.setattr(network, "local_addresses", lambda ipv6: list(addresses))
    monkeypatch.setattr(renewal, "PERIOD", 0.01)
    return addresses


def served(port: int, folder) -> tuple[bytes, int]:
    """The certificate that a new connection gets, and its serial number."""
    trusting = ssl.create_default_context(cafile=folder / "certificates" / "ca.pem")
    with (
        socket.create_connection(("127.0.0.1", port)) as plain,
        trusting.wrap_socket(plain, server_hostname="127.0.0.1") as secure,
    ):
        found = secure.getpeercert(binary_form=True)
    assert found is not None
    return found, int(x509.load_der_x509_certificate(found).serial_number)


def test_a_machine_that_moves_gets_a_certificate_while_it_serves(tmp_path, other_address):
    """New connections get it, the one that is open stays, and the page's new address may connect."""
    said, told = [], threading.Event()

    def say(line: str) -> None:
        said.append(line)
        told.set()

    options = settings(tmp_path, host="0.0.0.0", names=())
    with opened(options, say=say) as way:
        port = int(way.pages[0].split(":")[2].split("/")[0])
        assert way.pages[0].startswith("https://192.168.1.20:")
        _, before = served(port, tmp_path)
        other_address[:] = [IPv4Address("10.0.0.7")]
        assert told.wait(LIMIT)
        certificate, after = served(port, tmp_path)
        assert after != before
        names = x509.load_der_x509_certificate(certificate).extensions.get_extension_for_class(
            x509.SubjectAlternativeName
        )
        assert IPv4Address("10.0.0.7") in names.value.get_values_for_type(x509.IPAddress)
        assert f"open https://10.0.0.7:{port}/#" in said[0]
        assert way.pose._door.origin_fault(f"https://10.0.0.7:{port}", f"10.0.0.7:{port}") is None


def test_both_families_of_addresses(tmp_path):
    if not socket.has_ipv6:
        pytest.skip("no IPv6")
    tracker = Tracker()
    with opened(settings(tmp_path, host="::", names=("::1", "127.0.0.1")), tracker) as way:
        context = ssl.create_default_context(cafile=tmp_path / "certificates" / "ca.pem")
        assert way.pages[0].startswith("https://[::1]:")
        for url in way.pages[:2]:
            send_poses(url, context)
        for host in ("[::1]", "127.0.0.1"):
            send_poses(way.local.replace("localhost", host), None)
        assert tracker.connections == 4
