"""The way to the page: certificates, addresses and sockets of a whole session, and the words for it."""

import ssl
from dataclasses import replace
from typing import Any

import pytest
from xr_browser import browse
from xr_samples import at, controller, packet

from xr_client import gateway
from xr_client.gateway import open_gateway
from xr_client.hud_board import HudBoard
from xr_client.key_files import CertificateError
from xr_client.packets import encode_packet
from xr_client.settings import Settings
from xr_client.tracker import Tracker


def settings(folder, **others: Any) -> Settings:
    return replace(
        Settings(host="127.0.0.1", port=0, local_port=0, names=("127.0.0.1",), certificates=folder / "certificates"),
        **others,
    )


def opened(options: Settings, tracker: Tracker | None = None, board: HudBoard | None = None) -> Any:
    return open_gateway(options, tracker or Tracker(), board or HudBoard(), lambda: None, lambda _data, _now: None)


def send_poses(url: str, context: ssl.SSLContext | None) -> dict[str, Any]:
    """Send some packets from the page's own origin; gives the first HUD that comes back."""
    origin, token = url.split("/#")

    async def work(http: Any) -> dict[str, Any]:
        query, headers = {"token": token}, {"Origin": origin}
        async with http.ws_connect(f"{origin}/pose", params=query, headers=headers, ssl=context or True) as socket:
            for seq in range(3):
                await socket.send_bytes(encode_packet(packet(seq, left=controller(at()))))
            while True:
                said = await socket.receive_json()
                if said["type"] == "hud":
                    return said

    return browse(work)


def test_a_headset_finds_its_way_over_the_network(tmp_path):
    tracker, board = Tracker(), HudBoard()
    with opened(settings(tmp_path), tracker, board) as way:
        context = ssl.create_default_context(cafile=tmp_path / "certificates" / "ca.pem")
        assert way.pages[0].startswith("https://127.0.0.1:")
        said = send_poses(way.pages[0], context)
        assert set(said["latency_ms"]) == {"headset", "video", "service", "solve"}
        assert tracker.connections == 1
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
