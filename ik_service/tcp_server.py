"""Length-prefixed messages over TCP, answered in the event loop: a solve is shorter than any hand-off to a worker.

- Any number of frames may arrive in one read, in any fragments; they are answered in order, one write each.
- A request that comes alone is answered at once. Where several wait on a connection, it takes turns with all others of
  which that is true: one answer to one of them for every look at what is new, so that who asks little waits for no
  more than one answer to those who ask much. While much of a connection waits, and while it asks more often than it
  may, it is not read.
- An answer may come later, from another thread. Until then what else arrived on that connection waits. Other
  connections do not notice.
- Of the requests of one stream that wait on a connection at the same time only the newest is worked on; the older are
  answered `superseded`, in their place.
- A request's time begins when the event loop woke up to the bytes that completed it, so that waiting for other
  connections counts.
- `TCP_NODELAY` is set, and on Linux `TCP_QUICKACK` again on every read: a client that sends header and body separately
  with Nagle's algorithm on, as OpenWBT's does, waits 40 ms for a delayed acknowledgement otherwise.
- A body that is no request gets an error reply and the connection stays open, until too many in a row were undecodable
  or unauthorized. A length beyond the limit gets an error reply and then the connection is closed, because the stream
  cannot be followed any further.
- When all connections are taken, one that has been silent for long makes place; where none has, a new one gets the
  reply `overloaded` and is closed.
- A frame that has begun and does not complete in time, a client that never reads its replies, and one whose machine has
  gone, close the connection without a reply.
- A client that closes its end is gone: an answer that is to come later is cancelled.

What answers a body is an `Answerer`, so the same server serves a bare echo in the benchmark.
"""

import asyncio
import errno
import ssl
import time
from collections import Counter, deque
from collections.abc import Callable

from ik_proto import Status
from ik_proto.host_port import HostPort
from ik_service.addresses import AddressInUse
from ik_service.logs import log, values
from ik_service.tcp_connection import Answerer, Connection
from ik_service.tcp_limits import TcpLimits

__all__ = ["Answerer", "TcpLimits", "TcpServer"]

Refuse = Callable[[Status, str], bytes]

_LOG_EVERY_S = 1.0
"""A client that comes back as often as it is thrown out must not fill the log."""


class TcpServer:
    """Accepts connections and keeps their limits.

    Attributes:
        limits: Its limits.
        refuse: Makes the reply body for a status and a message.
        clock: Monotonic time [s].
        closed: Connections the server closed, by reason.
    """

    def __init__(
        self,
        answerer: Callable[[], Answerer],
        refuse: Refuse,
        limits: TcpLimits | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        """Take what answers.

        Args:
            answerer: Called once a connection; gives what answers its requests.
            refuse: Makes the reply body for a status and a message.
            limits: Other than the defaults.
            clock: Monotonic time [s]; the clock of the answerers.
        """
        self.limits = limits or TcpLimits()
        self.refuse = refuse
        self.clock = clock
        self.closed: Counter[str] = Counter()
        self._answerer = answerer
        self._connections: set[Connection] = set()
        self._server: asyncio.Server | None = None
        self._woke: float | None = None
        self._queue: deque[Connection] = deque()
        self._turn: asyncio.Handle | None = None
        self._logged: dict[str, float] = {}

    async def start(self, address: HostPort, ssl: ssl.SSLContext | None = None) -> HostPort:
        """Listen.

        Args:
            address: Where; port 0 lets the system choose.
            ssl: For TLS; None for plain TCP.

        Returns:
            The address with the port that was chosen.

        Raises:
            AddressInUse: Another process listens there.
            OSError: The system does not allow it.
        """
        self._loop = asyncio.get_running_loop()
        try:
            self._server = await self._loop.create_server(
                lambda: Connection(self, self._answerer()),
                address.host,
                address.port,
                backlog=self.limits.backlog,
                ssl=ssl,
                ssl_handshake_timeout=self.limits.handshake_s if ssl else None,
                ssl_shutdown_timeout=self.limits.linger_s if ssl else None,
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
                read [s]. What is not answered by then is refused.
        """
        loop = asyncio.get_running_loop()
        if self._server is not None:
            self._server.close()
        # Two turns of the loop read whatever the kernel holds already.
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

    def woke(self) -> float:
        """When the event loop woke up to the bytes that are being looked at [s]."""
        if len(self._connections) < 2:  # no other to wait for, and the extra turn of the loop costs 5 us
            return self.clock()
        if self._woke is None:
            self._woke = self.clock()
            self._loop.call_soon(self._forget_woke)  # runs before the loop waits again
        return self._woke

    def queue_turn(self, connection: Connection) -> None:
        """Give a connection its turn after those that were here before, one for each turn of the event loop."""
        self._queue.append(connection)
        if self._turn is None:
            self._turn = self._loop.call_soon(self._give_turn)

    def admit(self, connection: Connection) -> bool:
        """Note a new connection, make place for it if need be, and say whether it may be served."""
        self._connections.add(connection)
        served = [other for other in self._connections if not other.leaving]
        if len(served) <= self.limits.connections:
            return True
        now, limits = self.clock(), self.limits
        silent = [
            other
            for other in served
            if other is not connection
            and not other.busy
            and now - other.heard > (limits.silent_s if other.spoke else limits.first_frame_s)
        ]
        if not silent:
            return False
        self.note_closed("silent")
        min(silent, key=lambda other: other.heard).close()
        return True

    def forget(self, connection: Connection) -> None:
        """Note that a connection is gone."""
        self._connections.discard(connection)

    def note_closed(self, reason: str, **named: object) -> None:
        """Count a connection that the server closes, and log it unless one was logged just now.

        Args:
            reason: Why, in two words.
            named: The limit that it broke.
        """
        self.closed[reason] += 1
        now = self.clock()
        if now - self._logged.get(reason, -_LOG_EVERY_S) >= _LOG_EVERY_S:
            self._logged[reason] = now
            log.warning("connection closed", extra=values(reason=reason, times=self.closed[reason], **named))

    def _give_turn(self) -> None:
        connection = self._queue.popleft()
        self._turn = self._loop.call_soon(self._give_turn) if self._queue else None
        connection.turn()

    def _forget_woke(self) -> None:
        self._woke = None
