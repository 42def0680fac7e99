"""Opens the web server of a session: certificates, addresses, token; and tells a person how to get to the page."""

import secrets
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from xr_client.addresses import page_url, qr_code, usb_route
from xr_client.door import Door
from xr_client.hud_board import HudBoard
from xr_client.iwer import iwer_script
from xr_client.network import Network
from xr_client.pages import Pages
from xr_client.pose_socket import PoseSocket
from xr_client.server import Place, XrServer
from xr_client.settings import Settings
from xr_client.stages import Stages
from xr_client.tracker import Tracker
from xr_client.video_socket import VideoSocket


@dataclass(frozen=True, slots=True)
class Gateway:
    """A web server that listens.

    Attributes:
        pages: The page's URLs for headsets on the network, with the token, the best first.
        local: The page's URL on this machine, with the token.
        local_port: Its port.
        install: URL of the CA's certificate; empty without TLS.
        emulator: URL of the page with an emulated headset; empty where none was asked for.
        faults: Why headsets would refuse other addresses of this machine, a line each.
        pose: Handles poses.
        video: Takes images.
    """

    pages: tuple[str, ...]
    local: str
    local_port: int
    install: str
    emulator: str
    faults: tuple[str, ...]
    pose: PoseSocket
    video: VideoSocket

    def describe(self, *, with_qr_code: bool) -> Iterator[str]:
        """Lines that tell a person how to get to the page.

        Args:
            with_qr_code: Add a QR code of the first URL.
        """
        if self.pages:
            yield f"in the headset's browser, open {self.pages[0]}"
            yield from (f"  or {url}" for url in self.pages[1:])
            if with_qr_code:
                yield qr_code(self.pages[0])
            yield f"once per headset, to trust this machine: install {self.install}"
        yield from self.faults
        yield f"on this machine: {self.local}"
        yield usb_route(self.local, self.local_port)
        if self.emulator:
            yield f"with an emulated headset, in a browser on this machine: {self.emulator}"


@contextmanager
def open_gateway(
    settings: Settings,
    tracker: Tracker,
    board: HudBoard,
    stages: Stages,
    *,
    clear: Callable[[], None] = lambda: None,
    record: Callable[[bytes, float], None] = lambda _data, _now: None,
    say: Callable[[str], None] = lambda _line: None,
) -> Generator[Gateway]:
    """Serve the page for as long as the block lasts.

    Args:
        settings: Where, and with what certificates.
        tracker: Takes the poses.
        board: What to show.
        stages: Take the latencies of the sockets.
        clear: Called when a person has looked at the fault.
        record: Called with each packet that counts and its arrival.
        say: Tells a person of new addresses, in a line, from any thread.

    Raises:
        CertificateError: The certificates cannot be used.
        EmulatorError: The emulated headset cannot be had.
        ListenError: A port cannot be listened at.
    """
    emulator = iwer_script() if settings.emulate else None
    network = None if settings.local_only else Network(settings)
    hosts = network.hosts() if network else []
    token = secrets.token_urlsafe(16)
    door = Door(token, hosts)

    def arrived(data: bytes, now: float) -> None:
        record(data, now)
        age = pose.capture_to_arrival_ms
        if age is not None:
            stages["headset"].add(age)

    pose = PoseSocket(door, tracker, hud=board.hud, clear=clear, record=arrived)
    video = VideoSocket(door, shown=stages["video"].add)
    server = XrServer(Pages(ca_der=network.made.ca_der if network else None, emulator=emulator), pose, video)
    places = [Place("localhost", settings.local_port)]
    if network:
        places.append(Place(settings.host, settings.port, network.tls))
    renewal = None
    try:
        ports = server.start(*places)
        local = partial(page_url, "localhost", ports[0], token, secure=False)
        pages, faults = [], []
        if network:
            url = partial(page_url, port=ports[1], token=token, secure=True)
            pages, faults = network.offer(hosts, url)
            renewal = network.renewal(server, door, url, say)
            renewal.start()
        yield Gateway(
            pages=tuple(pages),
            local=local(),
            local_port=ports[0],
            install=f"{pages[0].split('#')[0]}ca.crt" if pages else "",
            emulator=local(path="/emulate") if emulator else "",
            faults=tuple(faults),
            pose=pose,
            video=video,
        )
    finally:
        if renewal is not None:
            renewal.stop()
        server.stop()
