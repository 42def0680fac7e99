"""A robot at the other end of a connection, as a `RobotPort`: the loop's end of the link.

- `read` gives the latest state and never waits; where it is older than `SILENT_AFTER` it raises `RobotSilent`.
- `send` never waits: a command that is not on its way when the next one comes is replaced by it.
- A connection that breaks is made again, with growing pauses. Until then commands go nowhere, which is the silence that
  the robot's end knows how to meet.
- Times of states are those of their arrival here.
"""

import asyncio
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from ssl import SSLContext, create_default_context
from types import TracebackType
from typing import Self, cast

import numpy as np

from ik_client.access import Access
from ik_client.address import parse_address
from ik_client.errors import IKError
from ik_client.robot_end.loop_thread import LoopThread
from ik_client.types import Command, RobotState
from ik_proto import JSON, FrameDecoder, encode_frame
from ik_proto.robot_link import (
    MAX_LINK_FRAME_BYTES,
    Hello,
    LinkCommand,
    LinkState,
    Welcome,
    command_document,
    hello_document,
    read_state,
    read_welcome,
)

SILENT_AFTER = 0.1
"""Age at which a state is no longer the robot's [s]."""

_CONNECT_LIMIT = 2.0
_FIRST_PAUSE, _LONGEST_PAUSE = 0.05, 1.0
_FLUSH_LIMIT = 0.2
_SEND_BUFFER = 8 * 1024
"""What the kernel may hold of commands under way [bytes]: little, so that none gets old there."""


class RobotSilent(IKError):
    """No state has come from the robot lately.

    Attributes:
        url: Its address.
    """

    def __init__(self, url: str, message: str) -> None:
        """Put the address in front of the message."""
        super().__init__(f"robot {url}: {message}")
        self.url = url


class RobotLink:
    """A robot behind `tcp://HOST:PORT`, or `tls://HOST:PORT`. Fits `RobotPort`; one link belongs to one thread."""

    def __init__(
        self,
        url: str,
        *,
        token: str | None = None,
        ssl: SSLContext | None = None,
        connect_timeout: float = _CONNECT_LIMIT,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Connect.

        Args:
            url: Where the robot's end listens.
            token: Its secret; None takes that of the environment variable `IK_TOKEN`, if any.
            ssl: For TLS, other than the system's defaults.
            connect_timeout: How long to wait for the first state [s].
            clock: Monotonic time [s].

        Raises:
            ValueError: The address is none, or the token.
            RobotSilent: No state came in time; says why.
        """
        address = parse_address(url)
        if address.scheme == "zenoh":
            raise ValueError(f"{url!r} is no address of a robot; write tcp://HOST:PORT or tls://HOST:PORT")
        self._url = url
        self._where = (address.host, address.port)
        self._token = Access.of(token, None, None, None, None).token
        self._ssl = ssl or (create_default_context() if address.scheme == "tls" else None)
        self._clock = clock
        self._fault = "does not answer"
        self._latest: tuple[LinkState, float] | None = None
        self._arrived = threading.Condition()
        self._welcome: Welcome | None = None
        self._protocol: _Stream | None = None
        self._slot: Command | None = None
        self._last: Command | None = None
        self._loop = LoopThread("robot link")
        self._loop.soon(self._begin)
        with self._arrived:
            there = self._arrived.wait_for(lambda: self._latest is not None, connect_timeout)
        if not there:
            self.close()
            raise RobotSilent(url, f"no state within {connect_timeout:g} s: {self._fault}")

    @property
    def welcome(self) -> Welcome:
        """What the robot said of itself: its name, its joints, its period."""
        assert self._welcome is not None  # a state comes after it, and a link exists after a state
        return self._welcome

    @property
    def weight(self) -> float:
        """How much our set-point counted at the latest state, 0 to 1."""
        return self._latest[0].weight if self._latest else 0.0

    def read(self) -> RobotState:
        """The latest state, without waiting for a new one.

        Raises:
            RobotSilent: It is older than `SILENT_AFTER`.
        """
        assert self._latest is not None  # a link exists after a first state
        state, arrived = self._latest
        age = self._clock() - arrived
        if not 0.0 <= age <= SILENT_AFTER:
            raise RobotSilent(self._url, f"no state for more than {SILENT_AFTER:g} s: {self._fault}")
        return RobotState(
            state.q,
            state.dq,
            arrived,
            waist=state.waist,
            q_set=state.q_set,
            tau_set=state.tau_set,
            ready=state.ready,
            following=state.following,
            note=state.note,
        )

    def send(self, command: Command) -> None:
        """Hand over a command, without waiting for anything."""
        self._last = self._slot = command
        self._loop.soon(self._flush)

    def release(self, timeout: float = 5.0) -> bool:
        """Ask the robot to take its arms back, and wait until it has.

        Args:
            timeout: How long at most [s].

        Returns:
            Whether its weight is 0. It is not where another session holds the robot, or where nobody answers.
        """
        assert self._latest is not None
        command = self._last or _nothing(self._latest[0].q)
        end = self._clock() + timeout
        while self._clock() < end:
            command = replace(command, seq=command.seq + 1, engaged=False, release=True, motion=None)
            self.send(command)
            with self._arrived:
                self._arrived.wait(min(self.welcome.period, end - self._clock()))
            state, arrived = self._latest
            if state.weight == 0.0 and 0.0 <= self._clock() - arrived <= SILENT_AFTER:
                return True
        return False

    def close(self) -> None:
        """Send what waits to be sent, and hang up. The robot holds."""
        if not self._loop.closed:
            self._loop.run(self._finish())
            self._loop.close()

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Hang up."""
        self.close()

    # What follows runs in the loop's thread.

    def _begin(self) -> None:
        self._task = asyncio.get_running_loop().create_task(self._keep_connected())

    async def _keep_connected(self) -> None:
        loop, pause = asyncio.get_running_loop(), _FIRST_PAUSE
        while True:
            host, port = self._where
            try:
                connecting = loop.create_connection(lambda: _Stream(self), host, port, ssl=self._ssl)
                _, stream = await asyncio.wait_for(connecting, _CONNECT_LIMIT)
            except (OSError, TimeoutError) as error:
                self._fault = f"nobody is there ({_words(error)})"
            else:
                try:
                    if await asyncio.shield(stream.ended):
                        pause = _FIRST_PAUSE
                finally:
                    stream.abort()
            await asyncio.sleep(pause)
            pause = min(2.0 * pause, _LONGEST_PAUSE)

    async def _finish(self) -> None:
        """Hang up when what waits has been sent; at once where that takes too long."""
        stream = self._protocol
        if stream is not None:
            self._flush()
            stream.hang_up()
            await asyncio.wait([stream.ended], timeout=_FLUSH_LIMIT)
            stream.abort()

    def _flush(self) -> None:
        """Send the command that waits, if it can go at once or there is nowhere to send it."""
        if self._protocol is None:
            self._slot = None  # It would be old by the time there is a connection.
        elif self._protocol.open and self._slot is not None:
            command, self._slot = self._slot, None
            self._protocol.send(command)

    def greeted(self, stream: "_Stream", welcome: Welcome) -> None:
        """The robot has let us in."""
        self._welcome, self._protocol, self._fault = welcome, stream, "does not answer"

    def came(self, state: LinkState) -> None:
        """A state has come."""
        with self._arrived:
            self._latest = (state, self._clock())
            self._arrived.notify_all()

    def drained(self) -> None:
        """There is room for the next command."""
        self._flush()

    def lost(self, fault: str) -> None:
        """The connection is gone."""
        self._protocol, self._fault = None, fault
        self._flush()


class _Stream(asyncio.Protocol):
    """One connection."""

    def __init__(self, link: RobotLink) -> None:
        self._link = link
        self._decoder = FrameDecoder(MAX_LINK_FRAME_BYTES)
        self._n = 0
        self._fault = "the connection was closed"
        self.ended: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
        self.open = True

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._transport.set_write_buffer_limits(high=0)
        connection: socket.socket = transport.get_extra_info("socket")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        self._write(hello_document(Hello(token=self._link._token)))

    def connection_lost(self, exc: Exception | None) -> None:
        if exc is not None:
            self._fault = f"the connection broke ({_words(exc)})"
        if self._n:
            self._link.lost(self._fault)
        else:
            self._link._fault = self._fault
        if not self.ended.done():
            self.ended.set_result(bool(self._n))

    def data_received(self, data: bytes) -> None:
        try:
            bodies = self._decoder.feed(data)
            if bodies and not self._n:
                welcome = read_welcome(JSON.decode(bodies.pop(0)))
                self._n = len(welcome.joint_names)
                self._link.greeted(self, welcome)
            if bodies:  # Only the newest is of interest.
                self._link.came(read_state(JSON.decode(bodies[-1]), self._n))
        except ValueError as error:  # what the robot's end sends is no message of this protocol, or a refusal
            self._fault = str(error)
            self._transport.abort()

    def pause_writing(self) -> None:
        self.open = False

    def resume_writing(self) -> None:
        self.open = True
        self._link.drained()

    def send(self, command: Command) -> None:
        fields = {name: getattr(command, name) for name in LinkCommand.__slots__}
        self._write(command_document(LinkCommand(**fields)))

    def hang_up(self) -> None:
        self._transport.close()

    def abort(self) -> None:
        self._transport.abort()

    def _write(self, document: dict) -> None:
        self._transport.write(encode_frame(JSON.encode(document)))


def _words(error: BaseException) -> str:
    # asyncio's own text of a refused connection names internals; the number's does not.
    number = getattr(error, "errno", None)
    return os.strerror(number).lower() if isinstance(number, int) and number > 0 else type(error).__name__


def _nothing(q: np.ndarray) -> Command:
    """The first command of a session that has nothing to say."""
    return Command(q, np.zeros(len(q)), 0.0, session=secrets.token_hex(6))
