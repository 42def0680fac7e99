"""The robot's end of the link: commands come in, states go out, over TCP. The contract is in `proto/robot_link.md`.

- Commands are stamped on arrival with the robot's own clock, and wait until the next control tick: the newest few of
  each connection. Whom they come from is the guard's business.
- States go to everybody who has said hello, in every control tick. Whoever is still reading the last one misses this
  one; whoever reads nothing for a while is dropped.
- A lost connection is nothing but silence.
- What is not a command is dropped and counted, and its sender is told in the next state's note.
"""

import asyncio
import hmac
import socket
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from ssl import SSLContext
from typing import cast

from ik_client.robot_end.loop_thread import LoopThread
from ik_client.types import Command
from ik_proto import JSON, DecodeError, FrameDecoder, FrameTooLarge, encode_frame
from ik_proto.robot_link import (
    MAX_LINK_FRAME_BYTES,
    LinkState,
    Welcome,
    read_command,
    read_hello,
    refusal_document,
    state_document,
    welcome_document,
)


@dataclass(frozen=True, slots=True)
class LinkLimits:
    """What a connection may cost.

    Attributes:
        connections: Connections at a time.
        hello_s: Time to the end of the hello [s].
        unread_s: How long a state may wait to be read [s].
        waiting: Commands of a connection that wait for the next control tick; older ones are dropped.
        send_buffer: What the kernel may hold of unread states [bytes].
    """

    connections: int = 4
    hello_s: float = 2.0
    unread_s: float = 1.0
    waiting: int = 8
    send_buffer: int = 16 * 1024


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """A command that has come.

    Attributes:
        command: The command.
        time: When it came, by the robot's clock [s].
        connection: Where from.
    """

    command: Command
    time: float
    connection: "Connection"


class LinkServer:
    """Listens for loops. Its methods are for the thread that runs the control ticks, and do not wait for the network.

    Attributes:
        tally: What happened to connections and messages: "connections", "refused", "dropped connections",
            "broken connections", "bad messages".
    """

    def __init__(
        self,
        welcome: Welcome,
        *,
        token: str = "",
        ssl: SSLContext | None = None,
        limits: LinkLimits | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Prepare.

        Args:
            welcome: What to tell a loop that says hello.
            token: The secret that a hello must carry; empty for none.
            ssl: For TLS; None for plain TCP.
            limits: Other than the defaults.
            clock: Monotonic time, the same as the guard's [s].
        """
        self.welcome = welcome
        self.limits = limits or LinkLimits()
        self.tally: Counter[str] = Counter()
        self.clock = clock
        self._token = token.encode()
        self._ssl = ssl
        self._connections: set[Connection] = set()
        self._left: deque[Arrival] = deque(maxlen=4 * self.limits.waiting)
        self._latest: tuple[LinkState, LinkState] | None = None
        self._server: asyncio.Server | None = None
        self._loop: LoopThread | None = None

    def start(self, host: str, port: int) -> int:
        """Listen.

        Args:
            host: Name or address.
            port: Port; 0 lets the system choose.

        Returns:
            The port.

        Raises:
            OSError: The system does not allow it, or another process listens there.
        """
        self._loop = LoopThread("robot link")
        try:
            return self._loop.run(self._listen(host, port))
        except OSError:
            self._loop.close()
            raise

    def take(self) -> list[Arrival]:
        """The commands that have come since the last call, in the order of their arrival."""
        arrivals = [arrival for connection in list(self._connections) for arrival in connection.take()]
        while self._left:
            arrivals.append(self._left.popleft())
        return sorted(arrivals, key=lambda arrival: arrival.time)

    def publish(self, state: LinkState, busy: LinkState) -> None:
        """Send the state of this control tick.

        Args:
            state: For whom the robot is there.
            busy: For those whose last command met a robot that another session holds.
        """
        pending, self._latest = self._latest is not None, (state, busy)
        if not pending and self._loop is not None:
            self._loop.soon(self._send)

    def close(self) -> None:
        """Close all connections and stop listening."""
        if self._loop is not None:
            self._loop.run(self._stop())
            self._loop.close()

    def admits(self, token: str) -> bool:
        """Whether a hello's token is the right one, compared in constant time."""
        return not self._token or hmac.compare_digest(token.encode(errors="backslashreplace"), self._token)

    def admit(self, connection: "Connection") -> bool:
        """Note a connection, and say whether there is room for it."""
        self._connections.add(connection)
        self.tally["connections"] += 1
        return len(self._connections) <= self.limits.connections

    def forget(self, connection: "Connection") -> None:
        """Note that a connection is gone. What it has brought still counts: a release is the last thing a loop says."""
        self._left.extend(connection.take())
        self._connections.discard(connection)

    async def _listen(self, host: str, port: int) -> int:
        loop = asyncio.get_running_loop()
        # A TLS handshake takes no longer than a hello may.
        handshake = self.limits.hello_s if self._ssl else None
        self._server = await loop.create_server(
            lambda: Connection(self), host, port, ssl=self._ssl, ssl_handshake_timeout=handshake
        )
        return self._server.sockets[0].getsockname()[1]

    async def _stop(self) -> None:
        if self._server is not None:
            self._server.close()
        for connection in list(self._connections):
            connection.close()
        await asyncio.sleep(0)

    def _send(self) -> None:
        latest, self._latest = self._latest, None
        if latest is None:
            return
        state, busy = latest
        for connection in list(self._connections):
            connection.publish(busy if connection.busy else state)


class Connection(asyncio.Protocol):
    """One loop, or somebody who only looks on.

    Attributes:
        busy: Whether its last command met a robot that another session holds; set by who runs the guard.
    """

    def __init__(self, server: LinkServer) -> None:
        """Begin; nothing is sent before the hello."""
        self.busy = False
        self._server = server
        self._decoder = FrameDecoder(MAX_LINK_FRAME_BYTES)
        self._arrivals: deque[Arrival] = deque(maxlen=server.limits.waiting)
        self._greeted = False
        self._fault = ""
        self._unread_since: float | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Start the clock for the hello; refuse where there is no room."""
        self._transport = cast(asyncio.Transport, transport)
        connection: socket.socket = transport.get_extra_info("socket")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, self._server.limits.send_buffer)
        self._hello_timer = asyncio.get_running_loop().call_later(self._server.limits.hello_s, self.drop)
        if not self._server.admit(self):
            self._refuse("the robot serves no more connections")

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._server.tally["broken connections"] += exc is not None
        self._hello_timer.cancel()
        self._server.forget(self)

    def data_received(self, data: bytes) -> None:
        """Read what came; of many commands only the newest few count."""
        try:
            bodies = self._decoder.feed(data)
        except FrameTooLarge as error:
            self._server.tally["bad messages"] += 1
            return self._refuse(str(error))
        if bodies and not self._greeted and not self._transport.is_closing():
            self._greet(bodies.pop(0))
        if self._greeted:
            for body in bodies[-self._server.limits.waiting :]:
                self._command(body)
        return None

    def take(self) -> list[Arrival]:
        """The commands that wait; called from another thread than the rest."""
        taken = []
        while self._arrivals:
            taken.append(self._arrivals.popleft())
        return taken

    def publish(self, state: LinkState) -> None:
        """Send a state, unless the last one is still unread."""
        if not self._greeted or self._transport.is_closing():
            return
        now = self._server.clock()
        if not self._transport.get_write_buffer_size():
            self._unread_since = None
            self._write(state_document(replace(state, note=self._fault) if self._fault else state))
        elif self._unread_since is None:
            self._unread_since = now
        elif not 0.0 <= now - self._unread_since <= self._server.limits.unread_s:
            self.drop()

    def drop(self) -> None:
        """Close it without a word."""
        self._server.tally["dropped connections"] += 1
        self._transport.abort()

    def close(self) -> None:
        """Close it when the last state is on its way."""
        self._transport.close()

    def _greet(self, body: bytes) -> None:
        self._hello_timer.cancel()
        try:
            hello = read_hello(JSON.decode(body))
        except (DecodeError, ValueError) as error:
            return self._refuse(str(error))
        if not self._server.admits(hello.token):
            return self._refuse("unauthorized: the robot demands a token, and this is not it")
        self._greeted = True
        self._write(welcome_document(self._server.welcome))
        return None

    def _command(self, body: bytes) -> None:
        try:
            read = read_command(JSON.decode(body), len(self._server.welcome.joint_names))
        except (DecodeError, ValueError) as error:
            self._server.tally["bad messages"] += 1
            self._fault = f"the last command was dropped: {error}"
            return
        self._fault = ""
        command = Command(**{name: getattr(read, name) for name in read.__slots__})
        self._arrivals.append(Arrival(command, self._server.clock(), self))

    def _refuse(self, error: str) -> None:
        self._server.tally["refused"] += 1
        self._write(refusal_document(error))
        self._transport.close()
        self._hello_timer.cancel()
        self._hello_timer = asyncio.get_running_loop().call_later(self._server.limits.hello_s, self._transport.abort)

    def _write(self, document: dict) -> None:
        self._transport.write(encode_frame(JSON.encode(document)))
