"""Opens the web server of a session: certificates, addresses, token; and tells a person how to get to the page."""

import datetime
import secrets
import ssl
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from xr_client.addresses import host_names, local_addresses, page_url, qr_code, usb_route
from xr_client.certificates import ensure_credentials
from xr_client.door import Door
from xr_client.hud_board import HudBoard
from xr_client.pages import Pages
from xr_client.pose_socket import PoseSocket
from xr_client.server import Place, XrServer
from xr_client.settings import Settings
from xr_client.tracker import Tracker
from xr_client.video_socket import VideoSocket

_LOOPBACK = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class Gateway:
    """A web server that listens.

    Attributes:
        pages: The page's URLs for headsets on the network, with the token, the best first.
        local: The page's URL on this machine, with the token.
        local_port: Its port.
        install: URL of the CA's certificate; empty without TLS.
        pose: Handles poses.
        video: Takes images.
    """

    pages: tuple[str, ...]
    local: str
    local_port: int
    install: str
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
        yield f"on this machine: {self.local}"
        yield usb_route(self.local, self.local_port)


@contextmanager
def open_gateway(
    settings: Settings,
    tracker: Tracker,
    board: HudBoard,
    clear: Callable[[], None],
    record: Callable[[bytes, float], None],
) -> Generator[Gateway]:
    """Serve the page for as long as the block lasts.

    Args:
        settings: Where, and with what certificates.
        tracker: Takes the poses.
        board: What to show; gets the latencies of the sockets.
        clear: Called when a person has looked at the fault.
        record: Called with each packet that counts and its arrival.

    Raises:
        CertificateError: The certificates cannot be used.
        ListenError: A port cannot be listened at.
    """
    token = secrets.token_urlsafe(16)
    networked = not settings.local_only
    hosts = [*settings.names, *map(str, local_addresses()), *host_names()] if networked else []
    tls, ca_der = None, None
    if networked:
        folder = settings.certificates.expanduser()
        made = ensure_credentials(folder, hosts, host_names(), datetime.datetime.now(datetime.UTC))
        tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        tls.minimum_version = ssl.TLSVersion.TLSv1_2
        tls.load_cert_chain(made.leaf, made.key)
        ca_der = made.ca_der
    door = Door(token, hosts)
    pose = PoseSocket(door, tracker, hud=board.hud, clear=clear, record=record)
    video = VideoSocket(door)
    board.add_stage("headset", lambda: pose.capture_to_arrival_ms)
    board.add_stage("video", lambda: video.shown_ms)
    server = XrServer(Pages(ca_der=ca_der), pose, video)
    places = [Place(_LOOPBACK, settings.local_port)]
    if networked:
        places.append(Place(settings.host, settings.port, tls))
    try:
        ports = server.start(*places)
        urls = [page_url(host, ports[1], token, secure=True) for host in hosts] if networked else []
        local = page_url("localhost", ports[0], token, secure=False)
        install = f"{urls[0].split('#')[0]}ca.crt" if urls else ""
        yield Gateway(tuple(urls), local, ports[0], install, pose, video)
    finally:
        server.stop()
