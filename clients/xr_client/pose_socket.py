"""The pose socket: packets and messages of one headset in, HUD and pings out.

| close code | when                                                                                                   |
|------------|--------------------------------------------------------------------------------------------------------|
| 4401       | the token is missing or wrong                                                                          |
| 4409       | another headset has been heard of within a second; or another one has taken over                       |
| 4400       | ten packets or messages in a row were none                                                             |
| 1009       | a message was larger than 4096 bytes                                                                   |
| 1001       | ik-xr ends                                                                                             |

The reason of a close says in words what a person can do. A wrong origin is refused before, with HTTP status 403.

One headset at a time: who connects while the other is silent for a second takes over, so that a headset that lost its
network can come back at once. What goes out is made when it is sent, so a page that does not read gets fewer messages,
never old ones, and holds up nothing.
"""

import asyncio
import contextlib
import time
from collections.abc import Callable

from aiohttp import WSMsgType, web

from xr_client.door import Door
from xr_client.messages import (
    MAX_MESSAGE_BYTES,
    Clear,
    Hello,
    Hud,
    MessageError,
    Pong,
    hud_message,
    ping_message,
    read_page_message,
)
from xr_client.packets import PacketError, decode_packet
from xr_client.page_clock import PageClock
from xr_client.tracker import Tracker

UNAUTHORIZED, BUSY, BAD_PACKETS = 4401, 4409, 4400
SILENCE = 1.0
"""How long a headset must have been silent for another one to take over [s]."""
BAD_IN_A_ROW = 10
HUD_PERIOD, PINGS = 0.05, 10
"""How often a HUD goes out [s], and how many of them go with a ping."""
_HEARTBEAT = 5.0
"""After how long without an answer a dead connection is closed [s]."""


class PoseSocket:
    """Handles `/pose`.

    Attributes:
        device: What the connected headset calls itself; empty without one.
        refused: Packets and messages that were none.
    """

    def __init__(
        self,
        door: Door,
        tracker: Tracker,
        *,
        hud: Callable[[], Hud] = Hud,
        clear: Callable[[], None] = lambda: None,
        record: Callable[[bytes, float], None] = lambda _data, _now: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Wait for a headset.

        Args:
            door: Who may connect.
            tracker: Takes the packets.
            hud: Gives what to show now.
            clear: Called when a person has looked at the fault.
            record: Called with the bytes of each packet that counts and its time of arrival.
            clock: Monotonic time [s]; the teleop loop's own.
        """
        self.device = ""
        self.refused = 0
        self._door = door
        self._tracker = tracker
        self._hud = hud
        self._clear = clear
        self._record = record
        self._clock = clock
        self._page_clock = PageClock()
        self._current: web.WebSocketResponse | None = None
        self._heard = 0.0

    @property
    def connected(self) -> bool:
        """Whether there is a headset."""
        return self._current is not None

    @property
    def round_trip_ms(self) -> float | None:
        """Shortest round trip to the page of late [ms]; None where it is not known."""
        return self._page_clock.round_trip_ms

    @property
    def capture_to_arrival_ms(self) -> float | None:
        """From the latest packet's capture to its arrival, to half a round trip [ms]; None where it is not known."""
        latest = self._tracker.latest
        return self.age_ms(latest.packet.capture_ms, latest.time) if latest else None

    def age_ms(self, page_ms: float, now: float) -> float | None:
        """How old something is that has the page's time, to half a round trip [ms]; None where that is not known.

        Args:
            page_ms: The page's time [ms].
            now: Our clock [s].
        """
        return self._page_clock.age_ms(page_ms, now * 1e3)

    async def handle(self, request: web.Request) -> web.StreamResponse:
        """Serve one connection, from its request to its end."""
        fault = self._door.origin_fault(request.headers.get("Origin"), request.headers.get("Host"))
        if fault:
            return web.Response(status=403, text=fault + "\n")
        socket = web.WebSocketResponse(
            max_msg_size=MAX_MESSAGE_BYTES, heartbeat=_HEARTBEAT, timeout=1.0, compress=False
        )
        await socket.prepare(request)
        fault = self._door.token_fault(request.query.get("token"))
        if fault:
            await socket.close(code=UNAUTHORIZED, message=fault.encode())
            return socket
        before = self._current
        if before is not None and not before.closed and self._clock() - self._heard < SILENCE:
            await socket.close(code=BUSY, message=b"another headset is connected: end its session first")
            return socket
        self._begin(socket)
        if before is not None:
            await before.close(code=BUSY, message=b"another headset has taken over")
        sender = asyncio.create_task(self._send(socket))
        try:
            await self._receive(socket)
        finally:
            self._end(socket)
            sender.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await sender
        return socket

    async def close(self) -> None:
        """End the connection, if there is one."""
        if self._current is not None:
            await self._current.close(code=1001, message=b"ik-xr has ended")

    def _begin(self, socket: web.WebSocketResponse) -> None:
        self._current, self._heard = socket, self._clock()
        self._page_clock, self.device = PageClock(), ""
        self._tracker.connect()

    def _end(self, socket: web.WebSocketResponse) -> None:
        if self._current is socket:
            self._current, self.device = None, ""
            self._tracker.disconnect()

    async def _receive(self, socket: web.WebSocketResponse) -> None:
        bad = 0
        async for message in socket:
            now = self._clock()
            if self._current is not socket:
                return
            try:
                if message.type is WSMsgType.BINARY:
                    self._take_packet(message.data, now)
                elif message.type is WSMsgType.TEXT:
                    self._take_message(message.data, now)
            except (PacketError, MessageError) as error:
                self.refused += 1
                bad += 1
                if bad >= BAD_IN_A_ROW:
                    await socket.close(code=BAD_PACKETS, message=str(error).encode()[:120])
                    return
            else:
                bad = 0

    def _take_packet(self, data: bytes, now: float) -> None:
        packet = decode_packet(data)
        self._heard = now
        if self._tracker.feed(packet, now):
            self._record(data, now)

    def _take_message(self, text: str, now: float) -> None:
        match read_page_message(text):
            case Hello(device=device):
                self.device = device
            case Pong(t_ms=t_ms, page_ms=page_ms):
                self._page_clock.pong(t_ms, page_ms, now * 1e3)
            case Clear():
                self._clear()

    async def _send(self, socket: web.WebSocketResponse) -> None:
        count = 0
        with contextlib.suppress(ConnectionError):
            while not socket.closed:
                if count % PINGS == 0:
                    await socket.send_str(ping_message(self._clock() * 1e3))
                await socket.send_str(hud_message(self._hud()))
                count += 1
                await asyncio.sleep(HUD_PERIOD)
