"""One TCP client: reads its requests no faster than they are answered, and answers them in order.

A request that comes alone is answered at once, in the read that brought it. Of several the first is; the others wait
for turns, which the server gives to one connection at a time. Requests that a newer one of their stream supersedes cost
next to nothing and go several a turn.
"""

import asyncio
import contextlib
import socket
from concurrent.futures import Future
from typing import TYPE_CHECKING, Protocol, cast

from ik_proto import Status, encode_frame
from ik_service.allowance import Allowance
from ik_service.inbox import Inbox, Waiting
from ik_service.logs import log

if TYPE_CHECKING:
    from ik_service.tcp_server import TcpServer

_SUPERSEDED = "a newer request of its stream came while it waited"
_SUPERSEDED_A_TURN = 16
_STOPPING = "the service is stopping; retry later"
_SHORTEST_WAIT_S = 1e-3
"""uvloop's timers count milliseconds, and take less than half of one for none."""


class Answerer(Protocol):
    """What answers the requests of one connection. No method raises."""

    @property
    def hopeless(self) -> int:
        """How many bodies in a row were none of a client worth listening to."""
        ...

    def answer(self, body: bytes, arrived: float, /) -> bytes | Future[bytes]:
        """Answer a body that arrived at a time [s], by the server's clock; now or later."""
        ...

    def refuse(self, body: bytes, status: Status, message: str, /) -> bytes:
        """Answer a body without doing what it asks."""
        ...

    def stream_of(self, body: bytes, /) -> str:
        """Tell which stream a body that has to wait belongs to; empty for none."""
        ...

    def supersede(self, stream: str, /) -> None:
        """Answer what is to be answered later, belongs to this stream and has not begun."""
        ...


class Connection(asyncio.Protocol):
    """One client.

    Attributes:
        leaving: Whether nothing of it is answered any more.
        heard: When it last sent something, or connected [s].
        spoke: Whether it ever sent a whole request.
    """

    def __init__(self, server: "TcpServer", answerer: Answerer) -> None:
        """Wait for `connection_made`.

        Args:
            server: Where it belongs.
            answerer: What answers its requests.
        """
        self.leaving = False
        self.spoke = False
        self.heard = server.clock()
        self._server = server
        self._limits = server.limits
        self._answerer = answerer
        self._inbox = Inbox(answerer.stream_of, self._limits.waiting_requests, self._limits.waiting_bytes)
        self._allowance = Allowance(self._limits.requests_per_s, self._limits.burst, self.heard)
        self._asked: Waiting | None = None
        self._coming: Future[bytes] | None = None
        self._turn_comes = False
        self._turn_timer: asyncio.TimerHandle | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._since_progress = 0  # bytes of the frame that has begun
        self._paused = False
        self._ended = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Set the socket up; refuse the client when all places are taken."""
        self._transport = cast(asyncio.Transport, transport)  # uvloop's is one in all but name
        self._loop = asyncio.get_running_loop()
        # Our own handle on the transport's descriptor: uvloop's is rebuilt for every option that is set.
        self._socket = socket.socket(fileno=transport.get_extra_info("socket").fileno())
        _set_options(self._socket, self._limits.keepalive_s)
        self._transport.set_write_buffer_limits(high=self._limits.unread_bytes)
        if not self._server.admit(self):
            limit = self._limits.connections
            self._refuse(Status.OVERLOADED, f"all {limit} connections are taken; close one or retry later", "no room")

    def data_received(self, data: bytes) -> None:
        """Take bytes, and answer what they complete."""
        acknowledge_quickly(self._socket)
        if self.leaving or self._inbox.fault is not None:
            return
        inbox, waited = self._inbox, len(self._inbox)
        self.heard = self._server.woke()
        inbox.feed(data, self.heard)
        complete = len(inbox) > waited
        if self._coming is not None:
            for stream in inbox.mark():
                self._answerer.supersede(stream)
        elif not self._turn_comes:
            self._answer_some()
        self._since_progress = 0 if complete else self._since_progress + len(data)
        self._pace(complete)

    def pause_writing(self) -> None:
        """Drop a client that does not read its replies."""
        self._server.note_closed("replies unread", unread_bytes=self._limits.unread_bytes)
        self.abort()

    def eof_received(self) -> bool:
        """Answer what a client that only listens any more has asked, but for what takes long."""
        self._ended = True
        return len(self._inbox) > 0 and self._coming is None and not self.leaving

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget everything."""
        if exc is not None:
            log.debug("connection broke", extra={"named": {"reason": str(exc)}})
        self.leaving = True
        if self._coming is not None:
            self._coming.cancel()
        self._inbox.clear()
        self._cancel_timer()
        if self._turn_timer is not None:
            self._turn_timer.cancel()
        self._socket.detach()
        self._server.forget(self)

    @property
    def busy(self) -> bool:
        """Whether part of a request has arrived, or an answer is to come."""
        return not self.leaving and (self._inbox.begun or len(self._inbox) > 0 or self._coming is not None)

    def close(self) -> None:
        """Refuse what is not answered yet, and close once the replies are sent."""
        if not self.leaving:
            self.leaving = True
            coming, self._coming = self._coming, None
            if coming is not None:
                coming.cancel()
                assert self._asked is not None
                self._write(self._answerer.refuse(self._asked.body, Status.OVERLOADED, _STOPPING))
            while len(self._inbox):
                self._write(self._answerer.refuse(self._inbox.take().body, Status.OVERLOADED, _STOPPING))
        self._transport.close()

    def abort(self) -> None:
        """Close at once."""
        self.leaving = True
        self._transport.abort()

    def turn(self) -> None:
        """Answer what may be answered in one turn."""
        self._turn_comes = False
        self._answer_some()
        self._pace(False)

    def _answer_some(self) -> None:
        """Answer one request, and what is superseded before it."""
        for _ in range(_SUPERSEDED_A_TURN):
            if self.leaving or not len(self._inbox):
                break
            wait_s = self._allowance.take(self._server.clock())
            if wait_s > 0.0:
                self._turn_comes = True
                self._turn_timer = self._loop.call_later(max(wait_s, _SHORTEST_WAIT_S), self._server.queue_turn, self)
                return
            waiting = self._inbox.take()
            if not waiting.superseded:
                self._answer(waiting)
                break
            self._write(self._answerer.refuse(waiting.body, Status.SUPERSEDED, _SUPERSEDED))
        self._go_on()

    def _answer(self, waiting: Waiting) -> None:
        self.spoke = True
        try:
            reply = self._answerer.answer(waiting.body, waiting.arrived)
        except Exception:  # a fault of ours must not take the connection along
            log.exception("no answer was made")
            reply = self._server.refuse(Status.INTERNAL, "the service failed on this request; its log says why")
        if isinstance(reply, bytes):
            self._write(reply)
        else:
            self._asked, self._coming = waiting, reply
            reply.add_done_callback(self._announce)

    def _go_on(self) -> None:
        """See to it that what waits has its turn; or end, where nothing more can come."""
        if self.leaving or self._transport.is_closing():
            return
        if self._answerer.hopeless >= self._limits.hopeless_bodies and self._coming is None:
            self._hang_up("hopeless bodies")
        elif self._ended and (self._coming is not None or not len(self._inbox)):
            self._transport.close()
        elif self._coming is not None:
            return
        elif len(self._inbox):
            self._turn_comes = True
            self._server.queue_turn(self)
        elif self._inbox.fault is not None:
            self._refuse(Status.BAD_REQUEST, str(self._inbox.fault), "oversized frame")

    def _announce(self, reply: Future[bytes]) -> None:
        """Take a reply from the thread that made it to the loop, if that still runs."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._reply, reply)

    def _reply(self, reply: Future[bytes]) -> None:
        if reply is not self._coming:
            return
        self._coming = self._asked = None
        if reply.cancelled() or self._transport.is_closing():
            return
        if (fault := reply.exception()) is not None:
            log.error("no answer was made", exc_info=fault)
            self._write(self._server.refuse(Status.INTERNAL, "the service failed on this request; its log says why"))
        else:
            self._write(reply.result())
        self._go_on()
        self._pace(True)

    def _write(self, reply: bytes) -> None:
        self._transport.write(encode_frame(reply))

    def _refuse(self, status: Status, message: str, reason: str) -> None:
        """Say why, then close."""
        self._write(self._server.refuse(status, message))
        self._hang_up(reason)

    def _hang_up(self, reason: str) -> None:
        """Answer nothing more; close after the client does, or after a while.

        Closing at once, with bytes of the client unread, would make the kernel reset the connection and the reply could
        be lost. TLS cannot close one direction only: it says goodbye and waits for the other's.
        """
        self._server.note_closed(reason)
        self.leaving = True
        self._inbox.clear()
        self._cancel_timer()
        if self._transport.can_write_eof():
            self._resume()
            self._transport.write_eof()
            self._timer = self._loop.call_later(self._limits.linger_s, self.abort)
        else:
            self._transport.close()

    def _pace(self, progressed: bool) -> None:
        """Read no more than can be answered; give a frame that has begun its time, but not while it may go unread."""
        if self.leaving or self._transport.is_closing():
            return
        if self._inbox.full and not self._paused:
            self._paused = True
            self._transport.pause_reading()
        elif self._paused and not self._inbox.full:
            self._resume()
        if not self._inbox.begun or self._paused or self._coming is not None:
            self._cancel_timer()
        elif self._timer is None or progressed or self._since_progress >= self._limits.frame_bytes:
            self._cancel_timer()
            self._since_progress = 0
            self._timer = self._loop.call_later(self._limits.frame_s, self._frame_is_late)

    def _resume(self) -> None:
        if self._paused:
            self._paused = False
            self._transport.resume_reading()

    def _frame_is_late(self) -> None:
        self._server.note_closed("late frame", frame_s=self._limits.frame_s)
        self.abort()

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


_QUICKACK = getattr(socket, "TCP_QUICKACK", None)


def acknowledge_quickly(connection: socket.socket) -> None:
    """Ask for the next acknowledgement at once; the system forgets it, so on every read. Linux only."""
    if _QUICKACK is not None:
        connection.setsockopt(socket.IPPROTO_TCP, _QUICKACK, 1)


def _set_options(connection: socket.socket, keepalive_s: int) -> None:
    """Send replies at once, and find out when the other end's machine has gone."""
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (("TCP_KEEPIDLE", keepalive_s), ("TCP_KEEPINTVL", max(keepalive_s // 3, 1)), ("TCP_KEEPCNT", 3)):
        if (option := getattr(socket, name, None)) is not None:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)
