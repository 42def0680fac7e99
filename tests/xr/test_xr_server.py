"""The web server as a browser meets it: real sockets, and clients that stall, lie, or come from elsewhere."""

import asyncio
import contextlib
import datetime
import ssl
import threading
from collections.abc import Iterator
from typing import Any

import aiohttp
import pytest
from xr_browser import browse, until
from xr_samples import at, controller, packet

from ik_proto.stereo_packet import StereoFrame, decode_frame
from xr_client.certificates import ensure_credentials
from xr_client.door import Door
from xr_client.listening import ListenError
from xr_client.messages import ArmHud, Hud
from xr_client.packets import encode_packet
from xr_client.pages import Pages
from xr_client.pose_socket import BAD_IN_A_ROW, HUD_PERIOD, PoseSocket
from xr_client.server import LOCAL_RESERVE, MAX_CONNECTIONS, Place, XrServer
from xr_client.tracker import Tracker
from xr_client.video_socket import MAX_PAGES, VideoSocket

TOKEN = "0123456789abcdef"
HALF = b"GET / HTTP/1.1\r\nHost: a\r\n"
NOW = datetime.datetime.now(datetime.UTC)


class Clock:
    """Monotonic time that stands still unless told otherwise."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Rig:
    """A server on a free port of the loopback address, and what it drives."""

    def __init__(self, folder, **limits: Any) -> None:
        self.clock = Clock()
        self.tracker = Tracker()
        self.cleared = threading.Event()
        self.recorded: list[tuple[bytes, float]] = []
        door = Door(TOKEN, [])
        self.hud = Hud()
        self.pose = PoseSocket(
            door,
            self.tracker,
            hud=lambda: self.hud,
            clear=self.cleared.set,
            record=lambda data, now: self.recorded.append((data, now)),
            clock=self.clock,
        )
        self.video = VideoSocket(door, self.clock)
        self.server = XrServer(Pages(folder, b"certificate"), self.pose, self.video, **limits)

    def start(self, *others: Place) -> None:
        self.ports = self.server.start(Place("127.0.0.1", 0), *others)
        self.url = f"http://127.0.0.1:{self.ports[0]}"

    @property
    def admitted(self) -> int:
        """Connections that the server knows of."""
        runner: Any = self.server._runner
        return len(runner.server.connections)

    def open(
        self, http: Any, path: str, *, token: str | None = TOKEN, origin: str | None = None, **options: Any
    ) -> Any:
        query = {} if token is None else {"token": token}
        return http.ws_connect(self.url + path, params=query, headers={"Origin": origin or self.url}, **options)


@pytest.fixture
def folder(tmp_path):
    web = tmp_path / "web"
    web.mkdir()
    (web / "index.html").write_text("<!doctype html><title>ik-xr</title>")
    (web / "page.js").write_text("export const one = 1;")
    (tmp_path / "secret.txt").write_text("secret")
    (web / "link.txt").symlink_to(tmp_path / "secret.txt")
    return web


@pytest.fixture
def rig(folder) -> Iterator[Rig]:
    made = Rig(folder)
    made.start()
    yield made
    made.server.stop()


async def closed(ws: Any) -> tuple[int, str]:
    """Code and reason of the server's close, whatever it says before."""
    while True:
        message = await ws.receive()
        if message.type is aiohttp.WSMsgType.CLOSE:
            return message.data, message.extra


def sent(seq: int, **others: Any) -> bytes:
    return encode_packet(packet(seq, left=controller(at()), **others))


def test_the_page_is_served_with_headers_that_keep_it_here(rig):
    async def work(http):
        for path, kind in (("/", "text/html"), ("/index.html", "text/html"), ("/page.js", "text/javascript")):
            async with http.get(rig.url + path) as answer:
                assert (answer.status, answer.content_type) == (200, kind)
                policy = answer.headers["Content-Security-Policy"]
                assert "default-src 'self'" in policy
                assert "unsafe" not in policy
                assert "http" not in policy
                assert answer.headers["X-Content-Type-Options"] == "nosniff"
        async with http.get(rig.url + "/ca.crt") as answer:
            assert (await answer.read(), answer.content_type) == (b"certificate", "application/x-x509-ca-cert")

    browse(work)


@pytest.mark.parametrize(
    "path", ["/absent", "/../secret.txt", "/%2e%2e/secret.txt", "/..%2fsecret.txt", "/link.txt", "/%00", "//etc/passwd"]
)
def test_nothing_else_is(rig, path):
    from yarl import URL

    async def work(http):
        async with http.get(URL(rig.url + path, encoded=True)) as answer:
            assert answer.status == 404
            assert "secret" not in await answer.text()
            assert "Content-Security-Policy" in answer.headers
        async with http.post(rig.url + "/") as answer:
            assert answer.status == 405

    browse(work)


@pytest.mark.parametrize("path", ["/pose", "/video"])
@pytest.mark.parametrize(
    ("origin", "words"), [("https://evil.example", "served by somebody else"), ("null", "only pages served here")]
)
def test_another_origin_is_refused_in_words(rig, path, origin, words):
    async def work(http):
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await rig.open(http, path, origin=origin)
        assert refused.value.status == 403
        async with http.get(rig.url + path, headers={"Origin": origin}) as answer:
            assert words in await answer.text()

    browse(work)
    assert rig.tracker.connections == 0


@pytest.mark.parametrize("path", ["/pose", "/video"])
@pytest.mark.parametrize(("token", "words"), [(None, "token is missing"), ("0123", "wrong token")])
def test_a_wrong_token_is_refused_in_words(rig, path, token, words):
    async def work(http):
        async with rig.open(http, path, token=token) as ws:
            await ws.send_bytes(sent(1))
            code, reason = await closed(ws)
            assert code == 4401
            assert words in reason

    browse(work)
    assert rig.tracker.connections == 0
    assert not rig.video.watched


def test_packets_reach_the_tracker_and_the_recording_and_a_closed_page_has_no_hands(rig):
    async def work(http):
        async with rig.open(http, "/pose") as ws:
            for seq in (1, 2, 2, 5):
                await ws.send_bytes(sent(seq))
            await until(lambda: rig.tracker.latest and rig.tracker.latest.packet.seq == 5)
            assert rig.tracker.latest.time == rig.clock.now
            assert rig.pose.connected
        await until(lambda: not rig.pose.connected)

    browse(work)
    assert rig.tracker.hands(rig.clock.now) is None
    assert rig.tracker.order.dropped == 1
    assert rig.recorded == [(sent(seq), 100.0) for seq in (1, 2, 5)]


def test_what_is_shown_goes_out_and_what_a_page_says_comes_in(rig):
    rig.hud = Hud(left=ArmHud("hold", "the hand is lost"))

    async def work(http):
        async with rig.open(http, "/pose") as ws:
            seen = {}
            while len(seen) < 2:
                said = await ws.receive_json()
                seen[said["type"]] = said
            assert seen["hud"]["left"]["reason"] == "the hand is lost"
            t_ms = seen["ping"]["t_ms"]
            assert t_ms == rig.clock.now * 1e3
            await ws.send_json({"type": "hello", "page": "1", "device": "Quest"})
            rig.clock.now += 0.004
            await ws.send_json({"type": "pong", "t_ms": t_ms, "page_ms": 5002.0})
            await ws.send_json({"type": "clear"})
            await until(rig.cleared.is_set)
            assert rig.pose.device == "Quest"
            assert rig.pose.round_trip_ms == pytest.approx(4.0)
            await ws.send_bytes(sent(1, capture_ms=4992.0))
            await until(lambda: rig.tracker.latest)
            assert rig.pose.capture_to_arrival_ms == pytest.approx(12.0)

    browse(work)


def test_one_headset_at_a_time_until_it_is_silent(rig):
    async def work(http):
        async with rig.open(http, "/pose") as first, rig.open(http, "/pose") as second:
            assert await closed(second) == (4409, "another headset is connected: end its session first")
            await first.send_bytes(sent(7))
            await until(lambda: rig.tracker.latest)
            rig.clock.now += 1.01
            async with rig.open(http, "/pose") as third:
                assert await closed(first) == (4409, "another headset has taken over")
                assert rig.tracker.latest is None
                await third.send_bytes(sent(1))
                await until(lambda: rig.tracker.latest)
                assert rig.tracker.connections == 2

    browse(work)


@pytest.mark.parametrize("bad", [b"junk", "junk"], ids=["packet", "message"])
def test_junk_is_counted_and_then_ends_the_connection(rig, bad):
    async def work(http):
        async with rig.open(http, "/pose") as ws:
            send = ws.send_bytes if isinstance(bad, bytes) else ws.send_str
            for _ in range(BAD_IN_A_ROW - 1):
                await send(bad)
            await ws.send_bytes(sent(1))
            await until(lambda: rig.tracker.latest)
            for _ in range(BAD_IN_A_ROW):
                await send(bad)
            code, reason = await closed(ws)
            assert code == 4400
            assert "packet" in reason or "JSON" in reason

    browse(work)
    assert rig.pose.refused == 2 * BAD_IN_A_ROW - 1


def test_a_message_that_is_too_large_ends_the_connection(rig):
    async def work(http):
        async with rig.open(http, "/pose") as ws:
            await ws.send_bytes(bytes(5000))
            assert (await closed(ws))[0] == 1009

    browse(work)


def image(seq: int, size: int = 300_000) -> StereoFrame:
    return StereoFrame(seq, 10.0 * seq, bytes([seq % 256]) * size, b"r" * size)


def test_a_page_gets_the_latest_images(rig):
    async def work(http):
        async with rig.open(http, "/video") as ws:
            await until(lambda: rig.video.watched)
            rig.clock.now = 100.0
            for seq in range(1, 200):
                rig.video.publish(image(seq, 1000))
                await asyncio.sleep(0)
            got = []
            while not got or got[-1] < 199:
                frame = decode_frame(await ws.receive_bytes())
                assert frame.left[0] == frame.seq % 256
                got.append(frame.seq)
                await ws.send_json({"type": "shown", "seq": frame.seq})
            assert got == sorted(set(got))
            await until(lambda: rig.video.shown_ms == pytest.approx(100e3 - 1990.0))

    browse(work)


def test_a_stalled_video_socket_touches_no_pose(rig):
    """It acknowledges nothing and reads nothing: no more than its credits are under way, and poses go on."""

    async def work(http):
        async with rig.open(http, "/video", max_msg_size=0), rig.open(http, "/pose") as pose:
            await until(lambda: rig.video.watched)
            (page,) = rig.video._pages
            for seq in range(1, 301):
                rig.video.publish(image(seq))
                await pose.send_bytes(sent(seq))
                await until(lambda seq=seq: rig.tracker.latest and rig.tracker.latest.packet.seq == seq)
            assert page.slot.sent == 2
            assert rig.tracker.order.accepted == 300
            assert rig.tracker.order.dropped == rig.tracker.order.missed == 0

    browse(work)


def test_a_pose_socket_that_does_not_read_is_still_heard(rig):
    """The HUD goes nowhere; what the page sends is taken all the same."""
    made = []

    def hud() -> Hud:
        made.append(rig.hud)
        return Hud(note="x" * 8_000_000)  # more than the kernel holds for a reader who does not come

    rig.pose._hud = hud

    async def work(_http):
        reader, writer = await asyncio.open_connection("127.0.0.1", rig.ports[0], limit=1)
        writer.write(
            f"GET /pose?token={TOKEN} HTTP/1.1\r\nHost: 127.0.0.1:{rig.ports[0]}\r\nOrigin: {rig.url}\r\n"
            "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
        )
        for seq in range(1, 301):
            data = sent(seq)
            # A masked binary frame of 148 bytes, with a mask of zeros (RFC 6455, section 5.2).
            writer.write(bytes([0x82, 0x80 | 126]) + len(data).to_bytes(2, "big") + bytes(4) + data)
            await writer.drain()
            await until(lambda seq=seq: rig.tracker.latest and rig.tracker.latest.packet.seq == seq)
            await asyncio.sleep(HUD_PERIOD / 50)
        assert len(made) == 1
        writer.close()
        del reader

    browse(work)


def test_too_many_watch(rig):
    async def work(http):
        pages = [await rig.open(http, "/video") for _ in range(MAX_PAGES)]
        async with rig.open(http, "/video") as ws:
            assert (await closed(ws))[0] == 4409
        for page in pages:
            await page.close()
        await until(lambda: not rig.video.watched)

    browse(work)


def test_junk_on_the_video_socket_ends_it(rig):
    async def work(http):
        async with rig.open(http, "/video") as ws:
            await ws.send_bytes(b"junk")
            assert (await closed(ws))[0] == 4400

    browse(work)


def test_the_end_is_said(folder):
    rig = Rig(folder)
    rig.start()

    async def work(http):
        async with rig.open(http, "/pose") as pose, rig.open(http, "/video") as video:
            await until(lambda: rig.pose.connected and rig.video.watched)
            stopper = threading.Thread(target=rig.server.stop)
            stopper.start()
            assert await closed(pose) == (1001, "ik-xr has ended")
            assert await closed(video) == (1001, "ik-xr has ended")
            await pose.close()
            await video.close()
            await until(lambda: not stopper.is_alive())

    browse(work)
    rig.video.publish(image(1))  # after the end, nobody minds


def test_a_taken_port_is_told_in_words(rig, folder):
    other = Rig(folder)
    with pytest.raises(ListenError, match=f"127.0.0.1:{rig.ports[0]}: another program"):
        other.server.start(Place("127.0.0.1", rig.ports[0]))


@pytest.mark.parametrize("requests", [b"", HALF, b"GET /absent HTTP/1.1\r\nHost: a\r\n\r\n" + HALF])
def test_who_takes_too_long_for_a_request_is_let_go(folder, requests):
    """No request, half of one, half of a second one."""
    rig = Rig(folder, patience=0.05)
    rig.start()

    async def work(_http):
        reader, writer = await asyncio.open_connection("127.0.0.1", rig.ports[0])
        writer.write(requests)
        said = await reader.read()
        assert said.startswith(b"HTTP/1.1 404" if b"absent" in requests else b"")
        writer.close()

    try:
        browse(work)
    finally:
        rig.server.stop()


def test_a_page_that_is_there_is_not_let_go(folder):
    rig = Rig(folder, patience=0.05)
    rig.start()

    async def work(http):
        async with rig.open(http, "/pose") as ws:
            for seq in range(30):
                await ws.send_bytes(sent(seq))
                await asyncio.sleep(0.01)
            await until(lambda: rig.tracker.order.accepted == 30)

    try:
        browse(work)
    finally:
        rig.server.stop()


def test_there_is_room_for_so_many_and_the_network_takes_none_of_this_machines_places(folder, tmp_path):
    made = ensure_credentials(tmp_path / "certs", [], [], NOW)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(made.leaf, made.key)
    trusting = ssl.create_default_context(cafile=made.ca)
    rig = Rig(folder)
    rig.start(Place("127.0.0.1", 0, context))

    async def work(http):
        crowd = [await asyncio.open_connection("127.0.0.1", rig.ports[0]) for _ in range(MAX_CONNECTIONS)]
        await until(lambda: rig.admitted == MAX_CONNECTIONS)
        with pytest.raises(aiohttp.ClientConnectionError):
            await http.get(f"https://127.0.0.1:{rig.ports[1]}", ssl=trusting)
        crowd += [await asyncio.open_connection("127.0.0.1", rig.ports[0]) for _ in range(LOCAL_RESERVE - 1)]
        await until(lambda: rig.admitted == len(crowd))
        async with http.get(rig.url) as answer:
            assert answer.status == 200
            reader, writer = await asyncio.open_connection("127.0.0.1", rig.ports[0])
            with contextlib.suppress(ConnectionResetError):
                assert await reader.read() == b""
            crowd.append((reader, writer))
        for _, writer in crowd:
            writer.close()

    try:
        browse(work)
    finally:
        rig.server.stop()


def test_over_tls_with_the_private_ca(folder, tmp_path):
    """Page, packets and pictures by https and wss, for a client that trusts the CA and checks the host."""
    made = ensure_credentials(tmp_path / "certs", [], [], NOW)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(made.leaf, made.key)
    rig = Rig(folder)
    rig.start(Place("127.0.0.1", 0, context))
    rig.url = f"https://127.0.0.1:{rig.ports[1]}"
    trusting = ssl.create_default_context(cafile=made.ca)

    async def work(http):
        async with http.get(rig.url, ssl=trusting) as answer:
            assert answer.status == 200
        async with rig.open(http, "/pose", ssl=trusting) as ws:
            await ws.send_bytes(sent(3))
            await until(lambda: rig.tracker.latest)
        with pytest.raises(aiohttp.ClientConnectorCertificateError):
            await http.get(rig.url)

    try:
        browse(work)
    finally:
        rig.server.stop()
