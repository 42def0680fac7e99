"""Who is let in, what the page asks for, and which certificates a browser takes."""

import datetime
import os
import shutil
import ssl
import subprocess
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from chromium import Chromium, Tab
from PIL import Image
from playwright.async_api import Error
from xr_page import TOKEN, PageServer, enter, put_on, wait_for

from ik_proto.stereo_packet import StereoFrame
from xr_client.certificates import ensure_credentials
from xr_client.iwer import iwer_script
from xr_client.server import Place

NOW = datetime.datetime.now(datetime.UTC)
LONG_AGO = NOW - datetime.timedelta(days=500)


@pytest.fixture
def server(iwer) -> Iterator[PageServer]:
    made = PageServer(emulator=iwer_script())
    made.start()
    yield made
    made.stop()


class Stranger(ThreadingHTTPServer):
    """Another web server on this machine: it lays no rules on its page, and counts who comes."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Answer)
        self.visits: list[str] = []
        self.url = f"http://127.0.0.1:{self.server_port}"


class _Answer(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        assert isinstance(self.server, Stranger)
        self.server.visits.append(self.path)
        page = b"<!doctype html><title>a stranger</title>"
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.send_header("Content-Length", str(len(page)))
        self.send_header("Access-Control-Allow-Origin", "*")
        self.end_headers()
        self.wfile.write(page)

    def log_message(self, format: str, *arguments: object) -> None:
        """Say nothing."""


@pytest.fixture
def stranger() -> Iterator[Stranger]:
    made = Stranger()
    thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    yield made
    made.shutdown()
    thread.join()
    made.server_close()


def elsewhere(tab: Tab, server: PageServer) -> list[str]:
    """What pages of a tab asked for at any other origin than the server's."""
    own = urlsplit(server.url).netloc
    return [url for url in tab.requests if not url.startswith(("blob:", "data:")) and urlsplit(url).netloc != own]


def picture(colour: str) -> bytes:
    file = BytesIO()
    Image.new("RGB", (64, 48), colour).save(file, "JPEG")
    return file.getvalue()


def test_a_whole_session_with_video_asks_for_nothing_elsewhere(chromium, server):
    left, right = picture("red"), picture("blue")
    with chromium.tab() as tab:
        enter(tab, server)
        wait_for(lambda: server.video.watched, "the page watches")
        for seq in range(3):
            server.video.shown_ms = None
            server.video.publish(StereoFrame(seq, 0.0, left, right))
            wait_for(lambda: server.video.shown_ms is not None, "an image is shown")
        server.after(tab, "xrOperator.swapControllers(); xrOperator.recenter()")
        tab.js("xrDevice.activeSession.end()")
        tab.until("document.querySelector('#enter-vr').disabled === false")
        put_on(tab, server)
        assert {urlsplit(url).path for url in tab.requests} >= {"/emulate", "/pose", "/video", "/emulator/iwer.js"}
        assert elsewhere(tab, server) == []
        assert not [line for line in tab.console if "Content Security Policy" in line]


def test_a_page_that_asks_elsewhere_is_stopped_and_seen(chromium, stranger, tmp_path):
    """The same check on a page that is not ours; and what our rules make of it."""
    (tmp_path / "index.html").write_text(
        f'<!doctype html><img src="{stranger.url}/image"><script type="module" src="ask.js"></script>'
    )
    (tmp_path / "ask.js").write_text(
        f'globalThis.refused = fetch("{stranger.url}/fetch").then(() => false, () => true);\n'
        f'import("{stranger.url}/import.js").catch(() => 0);\n'
    )
    server = PageServer(folder=tmp_path)
    server.start()
    with chromium.tab() as tab:
        tab.goto(server.url)
        assert tab.js("refused") is True
        wait_for(lambda: sum("Content Security Policy" in line for line in tab.console) >= 3, "all three are refused")
        assert set(elsewhere(tab, server)) >= {f"{stranger.url}/image", f"{stranger.url}/import.js"}
        assert stranger.visits == []
    with chromium.tab() as tab:
        tab.goto(f"{stranger.url}/without-rules")
        assert tab.js(f"fetch('{server.url}/ask.js', {{ mode: 'no-cors' }}).then(() => true, () => false)") is False
    server.stop()


@pytest.mark.parametrize(("address", "words"), [("/", "has no token"), ("/#wrong-token-0000", "wrong token")])
def test_without_the_token_the_page_says_so_and_nobody_gets_in(chromium, server, address, words):
    with chromium.tab() as tab:
        tab.goto(server.url + address)
        tab.until("(words) => document.body.innerText.includes(words)", words)
        assert server.tracker.connections == 0
        assert not server.video.watched


def test_a_page_of_somebody_else_gets_no_socket(chromium, server, stranger):
    addresses = [f"{server.url.replace('http', 'ws')}/{path}?token={TOKEN}" for path in ("pose", "video")]
    attempt = """(address) => new Promise((resolve) => {
      const socket = new WebSocket(address);
      socket.onopen = () => resolve("open");
      socket.onclose = ({ code }) => resolve(code);
    })"""
    with chromium.tab() as tab:
        tab.goto(stranger.url)
        assert [tab.js(attempt, address) for address in addresses] == [1006, 1006]
        assert sum("403" in line for line in tab.console) == 2
        assert (server.tracker.connections, server.video.watched) == (0, False)
        # From the server's own page the same words open them.
        tab.goto(server.url + "/icon.svg")
        assert [tab.js(attempt, address) for address in addresses] == ["open", "open"]


@pytest.fixture
def home_that_trusts(tmp_path) -> Path:
    """A home folder whose certificate store trusts the authority of `tmp_path/certificates`, made long ago."""
    if shutil.which("certutil") is None:
        pytest.skip("no certutil: on Debian or Ubuntu, apt install libnss3-tools")
    credentials = ensure_credentials(tmp_path / "certificates", ["127.0.0.1"], [], LONG_AGO)
    store = tmp_path / "home" / ".pki" / "nssdb"
    store.mkdir(parents=True)
    certutil = ["certutil", "-d", f"sql:{store}"]
    subprocess.run([*certutil, "-N", "--empty-password"], check=True)
    subprocess.run([*certutil, "-A", "-t", "C,,", "-n", "ik-xr", "-i", credentials.ca], check=True)
    return tmp_path / "home"


def with_certificate(folder: Path, now: datetime.datetime) -> ssl.SSLContext:
    made = ensure_credentials(folder, ["127.0.0.1"], [], now)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(made.leaf, made.key)
    return context


def test_certificates_expired_unknown_and_trusted(chromium, iwer, tmp_path, home_that_trusts):
    folder = tmp_path / "certificates"
    expired, renewed = with_certificate(folder, LONG_AGO), with_certificate(folder, NOW)
    server = PageServer(emulator=iwer_script())
    ports = server.start(0, Place("127.0.0.1", 0, expired), Place("127.0.0.1", 0, renewed))
    old_url, new_url = (f"https://127.0.0.1:{port}" for port in ports[1:])
    with chromium.tab() as tab, pytest.raises(Error, match="ERR_CERT_AUTHORITY_INVALID"):
        tab.goto(new_url)
    trusting = Chromium(env={**os.environ, "HOME": str(home_that_trusts)})
    with trusting.tab() as tab, pytest.raises(Error, match="ERR_CERT_DATE_INVALID"):
        tab.goto(old_url)
    assert server.tracker.connections == 0
    server.url = new_url
    with trusting.tab() as tab:
        enter(tab, server)
        assert tab.js("isSecureContext && location.protocol === 'https:'") is True
        assert any(url.startswith("wss:") for url in tab.requests)
        assert elsewhere(tab, server) == []
    trusting.close()
    server.stop()
