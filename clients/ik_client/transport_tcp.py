"""JSON over TCP: one blocking socket, one write a request, frames of 4-byte length and body.

A connection that was used before and turns out broken is replaced once within the same request: solving twice does no
harm, and a service restarted between two requests goes unnoticed. A request that ran out of time takes its connection
with it, so that its late reply can never answer the next one.

A client with a token shows it in a small request of its own at the head of every connection, and is trusted from then
on: a service reads nothing large from a stranger.
"""

import contextlib
import ipaddress
import socket
import time
from collections.abc import Callable

from ik_client.access import NO_ACCESS, Access
from ik_client.address import Address
from ik_client.background import Background
from ik_client.backoff import Backoff
from ik_client.errors import ServiceUnavailable
from ik_proto import ANSWERS, JSON, FrameDecoder, FrameTooLarge, ReplyError, encode_frame
from ik_proto.limits import DEFAULT_TCP

_RECEIVE_BYTES = 65536
_TLS_ALERT = b"\x15\x03"
"""How a service that speaks TLS may begin what it says to a client that does not."""
_Sockaddr = tuple[socket.AddressFamily, tuple]


class _Broken(Exception):
    """The other end closed or reset the connection before a whole reply came."""


class TcpTransport:
    """A service behind `tcp://HOST:PORT`."""

    codec = JSON
    shows_token = True
    _doubt = "if it speaks TLS, write tls://"
    """What may be wrong where a service closes a connection."""
    _serve = "ik-service serve"

    def __init__(
        self, address: Address, clock: Callable[[], float] = time.monotonic, access: Access = NO_ACCESS
    ) -> None:
        """Remember where; connect with the first request.

        Args:
            address: Where the service is.
            clock: Monotonic time [s].
            access: What to show.
        """
        self._address = address
        self._clock = clock
        self._backoff = Backoff()
        self._fault = ""
        """What went wrong last: the reason to give while pausing."""
        self._greeting = JSON.encode({"verb": "info", "token": access.token}) if access.token else b""
        self._socket: socket.socket | None = None
        self._lookup: Background[list[_Sockaddr]] | None = None

    def request(self, body: bytes, deadline: float) -> bytes:
        """Send a request and wait for its reply; see `Transport.request`."""
        reused = self._socket is not None
        try:
            try:
                reply = self._exchange(body, deadline)
            except _Broken:
                if not reused:
                    raise
                reply = self._exchange(body, deadline)
        except _Broken:
            raise self._failed(self._advised(f"closes the connection without an answer ({self._doubt})")) from None
        except TimeoutError:
            self.reset()
            self._failed(self._advised("does not answer"))
            raise
        self._backoff.succeeded()
        return reply

    def reset(self) -> None:
        """Drop the connection."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def close(self) -> None:
        """Drop the connection."""
        self.reset()

    def _exchange(self, body: bytes, deadline: float) -> bytes:
        connection = self._socket
        try:
            if connection is None:
                connection = self._socket = self._connect(deadline)
                if self._greeting:
                    said = self._ask(connection, self._greeting, deadline)
                    if JSON.decode(said).get("status") not in ANSWERS:
                        self.reset()
                        return said  # a refusal of this connection is one of the request
            return self._ask(connection, body, deadline)
        except ConnectionError:
            self.reset()
            raise _Broken from None

    def _ask(self, connection: socket.socket, body: bytes, deadline: float) -> bytes:
        connection.settimeout(self._remaining(deadline))
        # A service without room says so and closes: what it said may be there to read although it reads no more.
        with contextlib.suppress(ConnectionError):
            connection.sendall(encode_frame(body))
        return self._receive(connection, deadline)

    def _receive(self, connection: socket.socket, deadline: float) -> bytes:
        decoder = FrameDecoder()
        while True:
            data = connection.recv(_RECEIVE_BYTES)
            if not data:
                raise ConnectionResetError
            try:
                frames = decoder.feed(data)
            except FrameTooLarge:
                if not data.startswith(_TLS_ALERT):
                    raise
                self.reset()
                raise self._failed(f"it speaks TLS; write tls://{self._address.authority}") from None
            if len(frames) > 1 or (frames and decoder.pending):
                raise ReplyError("more than one reply came for one request")
            if frames:
                return frames[0]
            connection.settimeout(self._remaining(deadline))

    def _connect(self, deadline: float) -> socket.socket:
        if self._backoff.pausing(self._clock()):
            raise ServiceUnavailable(self._address.url, self._fault)
        refusal: OSError | None = None
        for family, sockaddr in self._resolve(deadline):
            connection = socket.socket(family, socket.SOCK_STREAM)
            try:
                connection.settimeout(self._remaining(deadline))
                connection.connect(sockaddr)
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            except OSError as error:
                connection.close()
                if isinstance(error, TimeoutError):
                    raise
                refusal = error
            else:
                return connection
        message = self._advised(f"nobody is there ({_words(refusal)})")
        if isinstance(refusal, ConnectionRefusedError):  # known at once: no reason to pause
            raise ServiceUnavailable(self._address.url, message)
        raise self._failed(message)

    def _resolve(self, deadline: float) -> list[_Sockaddr]:
        """Addresses of the host, in order of preference."""
        host, port = self._address.host, self._address.port
        with contextlib.suppress(ValueError):
            family = socket.AF_INET6 if ipaddress.ip_address(host).version == 6 else socket.AF_INET
            return [(family, (host, port))]
        # The look-up takes no timeout. One under way goes on, and a later request takes its result.
        self._lookup = self._lookup or Background(lambda: _look_up(host, port))
        if not self._lookup.wait(deadline - self._clock()):
            raise TimeoutError
        lookup, self._lookup = self._lookup, None
        try:
            return lookup.result()
        except (OSError, UnicodeError) as error:
            raise self._failed(self._advised(f"host {host} is not known ({_words(error)})")) from None

    def _remaining(self, deadline: float) -> float:
        remaining = deadline - self._clock()
        if remaining <= 0.0:
            raise TimeoutError
        return remaining

    def _failed(self, message: str) -> ServiceUnavailable:
        """Count a failure that is worth a pause."""
        self._fault = message
        self._backoff.failed(self._clock())
        return ServiceUnavailable(self._address.url, message)

    def _advised(self, message: str) -> str:
        """A message, and how to start a service there."""
        where = self._address.authority
        command = self._serve + ("" if where == DEFAULT_TCP else f" --tcp {where}")
        return f"{message}; start a service with: {command}"


def _look_up(host: str, port: int) -> list[_Sockaddr]:
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return [(family, sockaddr) for family, _, _, _, sockaddr in found]


def _words(error: Exception | None) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).lower()
