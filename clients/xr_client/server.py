"""The web server of ik-xr: the page, the CA's certificate, and a socket each for poses and for video.

    GET /           the page and its files
    GET /ca.crt     the CA's certificate, to be installed in the headset
    GET /pose       WebSocket, `pose_socket`
    GET /video      WebSocket, `video_socket`

It listens at two places: with TLS where headsets reach it over the network, and without on the loopback address, which
browsers trust as it is: for a headset on a USB cable, and for trying things out.
"""

import asyncio
import errno
import ssl
import threading
from collections.abc import Coroutine
from dataclasses import dataclass
from typing import Any

from aiohttp import web

from xr_client.pages import Pages, with_headers
from xr_client.pose_socket import PoseSocket
from xr_client.video_socket import VideoSocket


class ListenError(ValueError):
    """A port cannot be listened at; says why, in one line."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where to listen.

    Attributes:
        host: Numeric address.
        port: TCP port; 0 lets the system choose.
        tls: With TLS; None without.
    """

    host: str
    port: int
    tls: ssl.SSLContext | None = None


class XrServer:
    """Serves from a thread of its own, beside the teleop loop."""

    def __init__(self, pages: Pages, pose: PoseSocket, video: VideoSocket) -> None:
        """Put the parts together; nothing listens before `start`.

        Args:
            pages: The page's files.
            pose: Handles poses.
            video: Handles video.
        """
        self._pages = pages
        self._pose = pose
        self._video = video
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="ik-xr server", daemon=True)
        self._runner: web.AppRunner | None = None

    def start(self, *places: Place) -> list[int]:
        """Listen.

        Args:
            places: Where.

        Returns:
            The port of each place.

        Raises:
            ListenError: A port is taken, or the system does not allow it. Nothing listens then.
        """
        self._thread.start()
        try:
            return self._run(self._start(places))
        except ListenError:
            self.stop()
            raise

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

    async def _start(self, places: tuple[Place, ...]) -> list[int]:
        app = web.Application(middlewares=[with_headers])
        app.router.add_get("/pose", self._pose.handle)
        app.router.add_get("/video", self._video.handle)
        self._pages.add_to(app.router)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.5)
        await self._runner.setup()
        for place in places:
            try:
                await web.TCPSite(self._runner, place.host, place.port, ssl_context=place.tls).start()
            except OSError as error:
                taken = "another program listens there" if error.errno == errno.EADDRINUSE else error.strerror
                raise ListenError(f"cannot listen at {place.host}:{place.port}: {taken}") from None
        return [address[1] for address in self._runner.addresses]

    async def _stop(self) -> None:
        await self._pose.close()
        await self._video.close()
        if self._runner is not None:
            await self._runner.cleanup()
