"""JSON over TCP: one blocking socket, one write a request, frames of 4-byte length and body.

A connection that was used before and turns out broken is replaced once within the same request: solving twice does no
harm, and a service restarted between two requests goes unnoticed. A request that ran out of time takes its connection
with it, so that its late reply can never answer the next one.
"""

import contextlib
import ipaddress
import socket
import time
from collections.abc import Callable

from ik_client.address import Address
from ik_client.background import Background
from ik_client.backoff import Backoff
from ik_client.errors import ServiceUnavailable
from ik_proto import JSON, FrameDecoder, ReplyError, encode_frame
from ik_proto.limits import DEFAULT_TCP

_RECEIVE_BYTES = 65536
_Sockaddr = tuple[socket.AddressFamily, tuple]


class _Broken(Exception):
    """The other end closed or reset the connection before a whole reply came."""


class TcpTransport:
    """A service behind `tcp://HOST:PORT`."""

    codec = JSON

    def __init__(self, address: Address, clock: Callable[[], float] = time.monotonic) -> None:
        """Remember where; connect with the first request.

        Args:
            address: Where the service is.
            clock: Monotonic time [s].
        """
        self._address = address
        self._clock = clock
        self._backoff = Backoff()
        self._fault = "does not answer"
        """What went wrong last: the reason to give while pausing."""
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
            raise self._failed("closes the connection without an answer") from None
        except TimeoutError:
            self.reset()
            self._failed("does not answer")
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
        connection = self._socket = self._socket or self._connect(deadline)
        try:
            connection.settimeout(self._remaining(deadline))
            # A service without room says so and closes: what it said may be there to read although it reads no more.
            with contextlib.suppress(ConnectionError):
                connection.sendall(encode_frame(body))
            return self._receive(connection, deadline)
        except ConnectionError:
            self.reset()
            raise _Broken from None

    def _receive(self, connection: socket.socket, deadline: float) -> bytes:
        decoder = FrameDecoder()
        while True:
            data = connection.recv(_RECEIVE_BYTES)
            if not data:
                raise ConnectionResetError
            frames = decoder.feed(data)
            if len(frames) > 1 or (frames and decoder.pending):
                raise ReplyError("more than one reply came for one request")
            if frames:
                return frames[0]
            connection.settimeout(self._remaining(deadline))

    def _connect(self, deadline: float) -> socket.socket:
        if self._backoff.pausing(self._clock()):
            raise self._unavailable(self._fault)
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
        message = f"nobody is there ({_words(refusal)})"
        if isinstance(refusal, ConnectionRefusedError):  # known at once: no reason to pause
            raise self._unavailable(message)
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
            raise self._failed(f"host {host} is not known ({_words(error)})") from None

    def _remaining(self, deadline: float) -> float:
        remaining = deadline - self._clock()
        if remaining <= 0.0:
            raise TimeoutError
        return remaining

    def _failed(self, message: str) -> ServiceUnavailable:
        """Count a failure that is worth a pause."""
        self._fault = message
        self._backoff.failed(self._clock())
        return self._unavailable(message)

    def _unavailable(self, message: str) -> ServiceUnavailable:
        where = self._address.authority
        command = "ik-service serve" + ("" if where == DEFAULT_TCP else f" --tcp {where}")
        return ServiceUnavailable(self._address.url, f"{message}; start a service with: {command}")


def _look_up(host: str, port: int) -> list[_Sockaddr]:
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return [(family, sockaddr) for family, _, _, _, sockaddr in found]


def _words(error: Exception | None) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).lower()
