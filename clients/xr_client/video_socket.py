"""The video socket: stereo images to pages, latest wins, with credits. Apart from the poses, so it cannot hold them up.

Close codes are those of the pose socket; 4409 says that four pages watch already. A page that stalls has two images
under way and one that waits, however long it stalls, and is closed when it does not answer the heartbeat.
"""

import asyncio
import contextlib
import math
import threading
import time
from collections.abc import Callable

from aiohttp import WSMsgType, web

from ik_proto.stereo_packet import StereoFrame, encode_frame
from xr_client.door import Door
from xr_client.messages import MessageError, read_shown
from xr_client.pose_socket import BAD_PACKETS, BUSY, UNAUTHORIZED
from xr_client.video_slot import VideoSlot

MAX_PAGES = 4
_MAX_ACKNOWLEDGEMENT = 256
_HEARTBEAT = 5.0


class _Page:
    """A page that watches."""

    def __init__(self, socket: web.WebSocketResponse) -> None:
        self.socket = socket
        self.slot = VideoSlot()
        self.news = asyncio.Event()


class VideoSocket:
    """Handles `/video`.

    Attributes:
        shown_ms: From taking the latest image that was shown to the page's word of it [ms]; None before.
    """

    def __init__(
        self,
        door: Door,
        clock: Callable[[], float] = time.monotonic,
        *,
        shown: Callable[[float], None] = lambda _ms: None,
    ) -> None:
        """Wait for pages.

        Args:
            door: Who may connect.
            clock: Monotonic time [s], that of the images.
            shown: Told how long it took from taking an image to the page's word that it was shown [ms].
        """
        self.shown_ms: float | None = None
        self._door = door
        self._clock = clock
        self._shown = shown
        self._pages: list[_Page] = []
        self._watch = threading.Event()
        self._want = threading.Event()
        self._timer: asyncio.TimerHandle | None = None
        self._lock = threading.Lock()
        self._latest: StereoFrame | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def watched(self) -> bool:
        """Whether anybody watches: else no image needs to be made."""
        return self._watch.is_set()

    def wait_watched(self, timeout: float) -> bool:
        """Wait, in any thread but the server's, until somebody watches.

        Args:
            timeout: How long at most [s].

        Returns:
            Whether somebody does.
        """
        return self._watch.wait(timeout)

    def wait_wanted(self, timeout: float) -> bool:
        """Wait, in any thread but the server's, until a new image is worth making, see `video_slot`.

        Args:
            timeout: How long at most [s].

        Returns:
            Whether it is.
        """
        return self._want.wait(timeout)

    def publish(self, frame: StereoFrame) -> None:
        """Hand over an image, from any thread and without waiting.

        Args:
            frame: The image; replaces one that was not taken yet.
        """
        self._want.clear()  # until it is seen what the pages do with this one
        with self._lock:
            waiting, self._latest = self._latest, frame
            loop = self._loop
        # At most one call is under way, so a busy event loop gathers no images.
        if loop is not None and waiting is None:
            with contextlib.suppress(RuntimeError):  # the loop has just ended
                loop.call_soon_threadsafe(self._offer)

    async def handle(self, request: web.Request) -> web.StreamResponse:
        """Serve one connection, from its request to its end."""
        fault = self._door.origin_fault(request.headers.get("Origin"), request.headers.get("Host"))
        if fault:
            return web.Response(status=403, text=fault + "\n")
        socket = web.WebSocketResponse(
            max_msg_size=_MAX_ACKNOWLEDGEMENT, heartbeat=_HEARTBEAT, timeout=1.0, compress=False
        )
        await socket.prepare(request)
        fault = self._door.token_fault(request.query.get("token"))
        if fault:
            await socket.close(code=UNAUTHORIZED, message=fault.encode())
            return socket
        if len(self._pages) >= MAX_PAGES:
            await socket.close(code=BUSY, message=b"four pages watch already: close one of them")
            return socket
        page = _Page(socket)
        self._pages.append(page)
        self._watch.set()
        with self._lock:
            self._loop, self._latest = asyncio.get_running_loop(), None
        self._look_who_wants()
        sender = asyncio.create_task(self._send(page))
        try:
            await self._receive(page)
        finally:
            self._pages.remove(page)
            if not self._pages:
                self._watch.clear()
            self._look_who_wants()
            sender.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await sender
        return socket

    async def close(self) -> None:
        """End all connections."""
        for page in list(self._pages):
            await page.socket.close(code=1001, message=b"ik-xr has ended")

    def _offer(self) -> None:
        with self._lock:
            frame, self._latest = self._latest, None
        if frame is not None:
            for page in self._pages:
                page.slot.offer(frame)
                page.news.set()

    def _look_who_wants(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        now = self._clock()
        pause = min((page.slot.worth_making(now) for page in self._pages), default=math.inf)
        if pause <= 0.0:
            self._want.set()
        else:
            self._want.clear()
            if pause < math.inf:
                self._timer = asyncio.get_running_loop().call_later(pause, self._look_who_wants)

    async def _receive(self, page: _Page) -> None:
        async for message in page.socket:
            try:
                if message.type is not WSMsgType.TEXT:
                    raise MessageError("a page says on this socket what it has shown, and nothing else")
                seq = read_shown(message.data)
            except MessageError as error:
                await page.socket.close(code=BAD_PACKETS, message=str(error).encode()[:120])
                return
            taken_ms = page.slot.acknowledge(seq, self._clock())
            if taken_ms is not None:
                self.shown_ms = self._clock() * 1e3 - taken_ms
                self._shown(self.shown_ms)
                page.news.set()

    async def _send(self, page: _Page) -> None:
        with contextlib.suppress(ConnectionError):
            while True:
                await page.news.wait()
                page.news.clear()
                while frame := page.slot.take(self._clock()):
                    await page.socket.send_bytes(encode_frame(frame))
                self._look_who_wants()
