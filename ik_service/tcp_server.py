"""Length-prefixed messages over TCP, answered in the event loop: a solve is shorter than any hand-off to a worker.

- Any number of frames may arrive in one read, in any fragments; they are answered in order, one write each.
- An answer may come later, from another thread. Until then what else arrived on that connection waits, and once much
  of it does, the connection is not read. Other connections do not notice.
- `TCP_NODELAY` is set, and on Linux `TCP_QUICKACK` again on every read: a client that sends header and body separately
  with Nagle's algorithm on, as OpenWBT's does, waits 40 ms for a delayed acknowledgement otherwise.
- A body that is no request gets an error reply and the connection stays open. A length beyond the limit gets an error
  reply and then the connection is closed, because the stream cannot be followed any further.
- A connection beyond the limit gets the reply `overloaded` and is closed.
- A frame that has begun and does not complete in time, or a client that never reads its replies, closes the connection
  without a reply.
- A client that closes its end is gone: an answer that is still to come is cancelled.
- An idle connection stays open.

What answers a body is a function, so the same server serves a bare echo in the benchmark.
"""

import asyncio
import contextlib
import errno
import socket
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import cast

from ik_proto import MAX_FRAME_BYTES, FrameDecoder, FrameTooLarge, Status, encode_frame
from ik_service.addresses import AddressInUse, HostPort
from ik_service.logs import log, values

Answer = Callable[[bytes], bytes | Future[bytes]]
Refuse = Callable[[Status, str], bytes]

_QUICKACK = getattr(socket, "TCP_QUICKACK", None)


@dataclass(frozen=True, slots=True)
class TcpLimits:
    """What one client may cost the others.

    Attributes:
        connections: Connections served at a time.
        unread_bytes: Replies that may wait in memory for a client to read them [bytes]; fits two of the largest.
        waiting_bytes: Requests that may wait in memory for an answer that comes later, before no more are read [bytes].
        frame_s: Time a frame may take from its first to its last byte [s].
        linger_s: Time a refused client has to read its last reply [s].
        backlog: Connections that may wait to be accepted.
    """

    connections: int = 64
    unread_bytes: int = 2 * MAX_FRAME_BYTES
    waiting_bytes: int = MAX_FRAME_BYTES
    frame_s: float = 5.0
    linger_s: float = 1.0
    backlog: int = 1024


class TcpServer:
    """Accepts connections and keeps their limits."""

    def __init__(
        self, connection_answer: Callable[[], Answer], refuse: Refuse, limits: TcpLimits | None = None
    ) -> None:
        """Take what answers.

        Args:
            connection_answer: Called once a connection; gives the function that turns a body into a reply body, or
                into one to come, and never raises.
            refuse: Makes the reply body for a status and a message.
            limits: Other than the defaults.
        """
        self.limits = limits or TcpLimits()
        self.refuse = refuse
        self._connection_answer = connection_answer
        self._connections: set[_Connection] = set()
        self._server: asyncio.Server | None = None

    async def start(self, address: HostPort) -> HostPort:
        """Listen.

        Args:
            address: Where; port 0 lets the system choose.

        Returns:
            The address with the port that was chosen.

        Raises:
            AddressInUse: Another process listens there.
            OSError: The system does not allow it.
        """
        loop = asyncio.get_running_loop()
        try:
            self._server = await loop.create_server(
                lambda: _Connection(self, self._connection_answer()),
                address.host,
                address.port,
                backlog=self.limits.backlog,
            )
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise AddressInUse(str(address), "--tcp") from None
            raise
        return HostPort(address.host, self._server.sockets[0].getsockname()[1])

    async def stop(self, grace_s: float = 0.5) -> None:
        """Accept nothing new, answer what has arrived, close.

        Args:
            grace_s: Time for frames that have begun to complete and for answers to come, and again for replies to be
                read [s].
        """
        loop = asyncio.get_running_loop()
        if self._server is not None:
            self._server.close()
        # Two turns of the loop read, and so answer, whatever the kernel holds already.
        for _ in range(2):
            await asyncio.sleep(0)
        deadline = loop.time() + grace_s
        while any(connection.busy for connection in self._connections) and loop.time() < deadline:
            await asyncio.sleep(0.005)
        for connection in list(self._connections):
            connection.close()
        deadline = loop.time() + grace_s
        while self._connections and loop.time() < deadline:
            await asyncio.sleep(0.005)
        for connection in list(self._connections):
            connection.abort()

    @property
    def connections(self) -> int:
        """Number of open connections."""
        return len(self._connections)

    def admit(self, connection: "_Connection") -> bool:
        """Note a new connection, and say whether it may be served."""
        self._connections.add(connection)
        return sum(not other.refused for other in self._connections) <= self.limits.connections

    def forget(self, connection: "_Connection") -> None:
        """Note that a connection is gone."""
        self._connections.discard(connection)


class _Connection(asyncio.Protocol):
    """One client."""

    def __init__(self, server: TcpServer, answer: Answer) -> None:
        self._server = server
        self._answer = answer
        self._limits = server.limits
        self._decoder = FrameDecoder()
        self._waiting: deque[bytes] = deque()
        self._coming: Future[bytes] | None = None
        self._fault: FrameTooLarge | None = None
        self.refused = False
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)  # uvloop's is one in all but name
        self._loop = asyncio.get_running_loop()
        # Our own handle on the transport's descriptor: uvloop's is rebuilt for every option that is set.
        self._socket = socket.socket(fileno=transport.get_extra_info("socket").fileno())
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._transport.set_write_buffer_limits(high=self._limits.unread_bytes)
        if not self._server.admit(self):
            limit = self._limits.connections
            self._refuse(Status.OVERLOADED, f"all {limit} connections are taken; close one or retry later")

    def data_received(self, data: bytes) -> None:
        if _QUICKACK is not None:
            self._socket.setsockopt(socket.IPPROTO_TCP, _QUICKACK, 1)
        if self.refused or self._fault is not None:
            return
        try:
            bodies = self._decoder.feed(data)
        except FrameTooLarge as error:
            bodies, self._fault = error.frames_before, error
        self._waiting += bodies
        self._answer_in_order()
        if not self.refused and (bodies or self._timer is None):
            self._time_frame()

    def pause_writing(self) -> None:
        log.warning(
            "client does not read its replies, connection dropped", extra=values(unread_bytes=self._limits.unread_bytes)
        )
        self.abort()

    def eof_received(self) -> bool:
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        if exc is not None:
            log.debug("connection broke", extra=values(reason=str(exc)))
        if self._coming is not None:
            self._coming.cancel()
        self._waiting.clear()
        self._cancel_timer()
        self._socket.detach()
        self._server.forget(self)

    @property
    def busy(self) -> bool:
        """Whether part of a request has arrived, or an answer is to come."""
        return not self.refused and (self._decoder.pending or self._coming is not None)

    def close(self) -> None:
        """Close once the replies written so far are sent."""
        self._transport.close()

    def abort(self) -> None:
        """Close at once."""
        self._transport.abort()

    def _answer_in_order(self) -> None:
        """Answer what waits, up to the first answer that comes later."""
        while self._waiting and self._coming is None:
            reply = self._answer(self._waiting.popleft())
            if isinstance(reply, bytes):
                self._transport.write(encode_frame(reply))
            else:
                self._coming = reply
                reply.add_done_callback(self._announce)
        if self._coming is None:
            if self._fault is not None:
                self._refuse(Status.BAD_REQUEST, str(self._fault))
        elif sum(map(len, self._waiting)) > self._limits.waiting_bytes:
            self._transport.pause_reading()

    def _announce(self, reply: Future[bytes]) -> None:
        """Take a reply from the thread that made it to the loop, if that still runs."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._reply, reply)

    def _reply(self, reply: Future[bytes]) -> None:
        self._coming = None
        if reply.cancelled() or self._transport.is_closing():
            return
        if (fault := reply.exception()) is not None:
            log.error("no answer was made, connection dropped", exc_info=fault)
            self.abort()
            return
        self._transport.write(encode_frame(reply.result()))
        self._answer_in_order()
        if self._coming is None and not self.refused and not self._transport.is_closing():
            self._transport.resume_reading()
            self._time_frame()

    def _refuse(self, status: Status, message: str) -> None:
        """Say why, then close: after the client does, or after a while.

        Closing at once, with bytes of the client unread, would make the kernel reset the connection and the reply could
        be lost.
        """
        self.refused = True
        self._transport.write(encode_frame(self._server.refuse(status, message)))
        self._transport.write_eof()
        self._cancel_timer()
        self._timer = self._loop.call_later(self._limits.linger_s, self.abort)

    def _time_frame(self) -> None:
        """Give the frame that has begun, if one has, its time to complete; not while it may go unread."""
        self._cancel_timer()
        if self._decoder.pending and self._coming is None:
            self._timer = self._loop.call_later(self._limits.frame_s, self._frame_is_late)

    def _frame_is_late(self) -> None:
        log.warning("frame not completed in time, connection dropped", extra=values(frame_s=self._limits.frame_s))
        self.abort()

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
