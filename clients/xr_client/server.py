"""The web server of ik-xr: the page, the CA's certificate, and a socket each for poses and for video.

    GET /           the page and its files
    GET /ca.crt     the CA's certificate, to be installed in the headset
    GET /pose       WebSocket, `pose_socket`
    GET /video      WebSocket, `video_socket`

It listens at two places: with TLS where headsets reach it over the network, and without on the loopback addresses,
which browsers trust as they are: for a headset on a USB cable, and for trying things out.

| limit                                              |                                                                 |
|----------------------------------------------------|-----------------------------------------------------------------|
| until a request's headers are there, or the next   | 10 s, as for the handshake of TLS; then the connection ends     |
| connections                                        | 64; those without TLS 16 more, so that the network cannot take  |
|                                                    | the places of this machine                                      |
"""

import asyncio
import socket
import ssl
import threading
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any

from aiohttp import web

from xr_client.listening import listen
from xr_client.pages import Pages, with_headers
from xr_client.pose_socket import PoseSocket
from xr_client.video_socket import VideoSocket

MAX_CONNECTIONS, LOCAL_RESERVE = 64, 16
PATIENCE = 10.0
"""How long a connection may take until the headers of a request are there [s]."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where to listen.

    Attributes:
        host: As `listening.listen` takes it.
        port: TCP port; 0 lets the system choose.
        tls: With TLS; None without.
    """

    host: str
    port: int
    tls: ssl.SSLContext | None = None


class XrServer:
    """Serves from a thread of its own, beside the teleop loop."""

    def __init__(self, pages: Pages, pose: PoseSocket, video: VideoSocket, patience: float = PATIENCE) -> None:
        """Put the parts together; nothing listens before `start`.

        Args:
            pages: The page's files.
            pose: Handles poses.
            video: Handles video.
            patience: How long a connection may take until the headers of a request are there [s].
        """
        self._pages = pages
        self._patience = patience
        self._pose = pose
        self._video = video
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="ik-xr server", daemon=True)
        self._runner: web.AppRunner | None = None
        self._servers: list[asyncio.Server] = []

    def start(self, *places: Place) -> list[int]:
        """Listen.

        Args:
            places: Where.

        Returns:
            The port of each place.

        Raises:
            ListenError: A port is taken, or the system does not allow it. Nothing listens then.
        """
        opened: list[list[socket.socket]] = []
        try:
            for place in places:
                opened += [listen(place.host, place.port)]
        except ValueError:
            for one in (one for sockets in opened for one in sockets):
                one.close()
            self.stop()
            raise
        self._thread.start()
        self._run(self._start(places, opened))
        return [sockets[0].getsockname()[1] for sockets in opened]

    def call(self, work: Callable[[], None]) -> None:
        """Do something between two events of the server, and wait for it.

        Args:
            work: What to do.
        """

        async def do() -> None:
            work()

        self._run(do())

    def stop(self) -> None:
        """End all connections and close."""
        if self._thread.is_alive():
            self._run(self._stop())
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
        if not self._loop.is_closed():
            self._loop.close()

    def _run(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    async def _start(self, places: tuple[Place, ...], opened: list[list[socket.socket]]) -> None:
        app = web.Application(middlewares=[with_headers])
        app.router.add_get("/pose", self._pose.handle)
        app.router.add_get("/video", self._video.handle)
        self._pages.add_to(app.router)
        # A connection that is kept open counts as one that takes its time for the next request.
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.5, keepalive_timeout=self._patience)
        await self._runner.setup()
        for place, sockets in zip(places, opened, strict=True):
            admit = self._admission(MAX_CONNECTIONS + (0 if place.tls else LOCAL_RESERVE))
            patience = self._patience if place.tls else None
            for one in sockets:
                server = self._loop.create_server(admit, sock=one, ssl=place.tls, ssl_handshake_timeout=patience)
                self._servers.append(await server)

    def _admission(self, limit: int) -> Callable[[], asyncio.BaseProtocol]:
        """Makes the protocol of a new connection; that of one too many ends it."""

        def admit() -> asyncio.BaseProtocol:
            server = self._runner.server if self._runner else None
            return server() if server and len(server.connections) < limit else _NoRoom()

        return admit

    async def _stop(self) -> None:
        await self._pose.close()
        await self._video.close()
        for server in self._servers:
            server.close()
        if self._runner is not None:
            await self._runner.cleanup()


class _NoRoom(asyncio.Protocol):
    """The protocol of a connection that there is no room for."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """End it at once."""
        if isinstance(transport, asyncio.Transport):
            transport.abort()
