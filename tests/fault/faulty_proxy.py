"""A TCP proxy that treats frames as a broken network would: real sockets, one thread for each direction.

What a plan says happens to whole frames, so that the same plan does the same whatever pieces the kernel reads. A late
frame is handed over just before the next one of its direction, be it on another connection: so a reply can come to a
client that has long given up on it and asks something else.
"""

import contextlib
import socket
import struct
import threading

from faults import Fault, Plan

from ik_proto import FrameDecoder, encode_frame

_RESET = struct.pack("ii", 1, 0)
"""SO_LINGER of no time at all: closing resets the connection."""


class _Hangup(Exception):
    """The proxy breaks the connection here."""


class FaultyProxy:
    """Listens on a port of its own and passes on what comes, or nearly.

    Attributes:
        target: Where new connections are passed on to [host, port].
        to_service: What happens to requests.
        to_client: What happens to replies.
        accepted: Connections so far.
    """

    def __init__(
        self,
        target: tuple[str, int],
        to_service: Plan | None = None,
        to_client: Plan | None = None,
        delay_s: float = 0.01,
    ) -> None:
        """Listen.

        Args:
            target: Where the service is.
            to_service: What happens to requests.
            to_client: What happens to replies.
            delay_s: How much later a delayed frame comes [s].
        """
        self.target = target
        self.to_service = to_service or Plan()
        self.to_client = to_client or Plan()
        self.accepted = 0
        self._delay_s = delay_s
        self._stopped = threading.Event()
        self._late: dict[bool, list[bytes]] = {True: [], False: []}
        self._lock = threading.Lock()
        self._open: set[socket.socket] = set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"
        self._threads = [threading.Thread(target=self._accept)]
        self._threads[0].start()

    def mend(self) -> None:
        """Let everything pass from now on, late frames included: they are forgotten."""
        self.to_service.mend()
        self.to_client.mend()
        with self._lock:
            for frames in self._late.values():
                frames.clear()

    def hang_up(self) -> None:
        """Break every connection."""
        with self._lock:
            ends = list(self._open)
        for end in ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def stop(self) -> None:
        """Break everything and wait for the threads."""
        self._stopped.set()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._threads[0].join(5.0)  # now nothing new is opened
        self.hang_up()
        for thread in self._threads:
            thread.join(5.0)
            assert not thread.is_alive()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            self.accepted += 1
            try:
                service = socket.create_connection(self.target, timeout=5.0)
            except OSError:
                client.close()
                continue
            service.settimeout(None)
            for end in (client, service):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            pair = _Pair(client, service)
            with self._lock:
                self._open |= {client, service}
            for source, sink, requests in ((client, service, True), (service, client, False)):
                thread = threading.Thread(target=self._pump, args=(source, sink, pair, requests))
                self._threads.append(thread)
                thread.start()

    def _pump(self, source: socket.socket, sink: socket.socket, pair: "_Pair", requests: bool) -> None:
        decoder = FrameDecoder()
        stalled = False
        try:
            while data := source.recv(65536):
                for body in decoder.feed(data):
                    stalled = stalled or self._pass_on(encode_frame(body), sink, requests)
        except (OSError, _Hangup):
            pass
        finally:
            with self._lock:
                self._open -= pair.ends
            pair.close()

    def _pass_on(self, frame: bytes, sink: socket.socket, requests: bool) -> bool:
        """Do with a frame what the plan says; True where nothing more shall come this way."""
        with self._lock:
            late, self._late[requests] = self._late[requests], []
        for old in late:
            sink.sendall(old)
        match (self.to_service if requests else self.to_client).next():
            case Fault.PASS:
                sink.sendall(frame)
            case Fault.SPLIT:
                step = max(1, len(frame) // 7)
                for at in range(0, len(frame), step):
                    sink.sendall(frame[at : at + step])
            case Fault.DELAY:
                self._stopped.wait(self._delay_s)
                sink.sendall(frame)
            case Fault.DUPLICATE:
                sink.sendall(frame + frame)
            case Fault.LATE:
                with self._lock:
                    self._late[requests].append(frame)
            case Fault.TRUNCATE:
                sink.sendall(frame[: len(frame) // 2])
                raise _Hangup
            case Fault.STALL:
                sink.sendall(frame[: len(frame) // 2])
                return True
            case Fault.CORRUPT:
                spoiled = bytearray(frame)
                spoiled[4 + (len(frame) - 4) // 3] = 0xC1  # in no UTF-8 text
                sink.sendall(spoiled)
            case Fault.RESET:
                sink.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
                raise _Hangup
            case Fault.DROP:
                pass
        return False


class _Pair:
    """Both ends of a connection, closed once and together."""

    def __init__(self, *ends: socket.socket) -> None:
        self.ends = set(ends)
        self._lock = threading.Lock()
        self._ended = 0

    def close(self) -> None:
        """End both directions; the sockets are closed when the second thread is through with them."""
        with self._lock:
            self._ended += 1
            last = self._ended == 2
        for end in self.ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            if last:
                end.close()
