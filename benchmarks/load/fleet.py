"""Many well-behaved clients in one thread: open loop, one connection each, requests encoded beforehand.

What `ik-load` does with a thread a client, cheap enough for dozens of clients beside the service on two cores. Like
there, requests are due at a constant rate whatever happens, latency counts from when one was due, and a client has one
request on the way at a time. An answer that takes longer than the timeout costs the connection, as in `IKClient`.
"""

import contextlib
import select
import socket
import time
from collections import deque
from collections.abc import Callable

import orjson

from ik_client import IKClient
from ik_client.load.generator import Schedule
from ik_client.load.outcomes import Outcomes
from ik_client.load.workloads import make_workload
from ik_proto import JSON, FrameDecoder, ProtocolError, SolveRequest, encode_frame, request_document

TIMEOUT_S = 1.0
_RECEIVE_BYTES = 65536
_LOOK_S = 0.02
"""How often the fleet looks for answers that are overdue [s]."""


def tracking_frames(url: str, rate: float, count: int, seed: int = 0) -> list[bytes]:
    """Requests of the workload `tracking`, framed; each starts from the joints of the frame before.

    Args:
        url: Address of the service, which tells where the wrists are.
        rate: Rate at which one client will send them [Hz].
        count: How many.
        seed: Decides the path.

    Returns:
        The frames.
    """
    with IKClient(url, timeout=TIMEOUT_S) as ik:
        path = make_workload("tracking", ik, seed=seed, rate=rate, frames=count)
    frames = []
    for k, q in enumerate(path.q):
        before = path.q[k - 1] if k else q
        request = SolveRequest(path.left[k], path.right[k], before, 0.0 * before, id=k + 1)
        frames.append(encode_frame(JSON.encode(request_document(request))))
    return frames


class Fleet:
    """Runs a schedule with many clients.

    Attributes:
        windows: What came of the requests, by the window of time they were due in.
    """

    def __init__(
        self,
        address: tuple[str, int],
        frames: list[bytes],
        clients: int,
        *,
        timeout: float = TIMEOUT_S,
        window: float = float("inf"),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Connect.

        Args:
            address: Host and port of the service.
            frames: Requests to send in turn, framed.
            clients: How many.
            timeout: How long an answer may take after its request was sent [s].
            window: Length of a window [s].
            clock: Monotonic time [s].
        """
        self.windows: list[Outcomes] = [Outcomes()]
        self._frames = frames
        self._timeout = timeout
        self._window = window
        self._clock = clock
        self._clients = [_Client(address, k * len(frames) // clients) for k in range(clients)]

    def run(
        self, schedule: Schedule, tell: Callable[[float], None] = lambda _: None, every: float = 1.0
    ) -> list[Outcomes]:
        """Send everything that is due; clients take turns within a period.

        Args:
            schedule: When. Its `period` is that of one client, its `grace` the time to wait for the last answers.
            tell: Called now and then with the time since the beginning [s].
            every: How often [s].

        Returns:
            The windows.
        """
        n = len(self._clients)
        j, due, told, look = 0, schedule.begin, schedule.begin, 0.0
        while True:
            now = self._clock()
            while due <= now and due < schedule.end:
                client = self._clients[j % n]
                client.due.append(due)
                self._send(client, schedule)
                j += 1
                due = schedule.begin + j * schedule.period / n
            if now >= look:
                look = now + _LOOK_S
                self._give_up(now - self._timeout, schedule)
            if due >= schedule.end and (now > schedule.end + schedule.grace or not self._busy()):
                break
            if now - told >= every:
                told = now
                tell(now - schedule.begin)
            self._receive(max(0.0, min(due if due < schedule.end else look, look) - self._clock()), schedule)
        self._record_unsent(schedule)
        return self.windows

    def close(self) -> None:
        """Close all connections."""
        for client in self._clients:
            client.close()

    def _busy(self) -> bool:
        return any(client.due for client in self._clients)

    def _send(self, client: "_Client", schedule: Schedule) -> None:
        """Send what has been due longest, unless an answer is still to come."""
        if client.sent is not None or not client.due:
            return
        frame = self._frames[client.next % len(self._frames)]
        client.sent = self._clock()
        outcomes = self._outcomes(client.due[0], schedule)
        if outcomes is not None:
            outcomes.lateness.record(client.sent - max(client.due[0], client.free))
        client.next += 1
        # A request is far smaller than the socket's buffer and the only one in it, so that it is taken at once.
        try:
            client.open().sendall(frame)
        except OSError as error:
            self._fail(client, type(error).__name__, schedule)

    def _receive(self, wait: float, schedule: Schedule) -> None:
        """Wait for answers. `select` because its timeout is finer than the millisecond of `epoll`."""
        waiting = {client.socket.fileno(): client for client in self._clients if client.socket is not None}
        for descriptor in select.select(waiting, (), (), wait)[0]:
            client = waiting[descriptor]
            assert client.socket is not None
            try:
                data = client.socket.recv(_RECEIVE_BYTES)
                bodies = client.decoder.feed(data)
            except (OSError, ProtocolError) as error:
                self._fail(client, type(error).__name__, schedule)
                continue
            if not data:
                self._fail(client, "closed by the service", schedule)
            elif bodies:
                self._answer(client, bodies[0], schedule)

    def _answer(self, client: "_Client", body: bytes, schedule: Schedule) -> None:
        done = self._clock()
        if client.sent is None:
            self._fail(client, "an answer nobody asked for", schedule)
            return
        due, sent = client.due.popleft(), client.sent
        client.sent, client.free = None, done
        outcomes = self._outcomes(due, schedule)
        if outcomes is not None:
            reply = orjson.loads(body)
            outcomes.latency.record(done - due)
            outcomes.round_trip.record(done - sent)
            outcomes.solve.record(reply["solve_us"] * 1e-6)
            outcomes.statuses[reply["status"]] += 1
            outcomes.good += reply["success"]
        self._send(client, schedule)

    def _fail(self, client: "_Client", kind: str, schedule: Schedule) -> None:
        """The connection is of no use any more; the request on the way, if any, has failed."""
        client.close()
        if client.sent is None:
            return
        due = client.due.popleft()
        client.sent, client.free = None, self._clock()
        outcomes = self._outcomes(due, schedule)
        if outcomes is not None:
            outcomes.errors[kind] += 1

    def _give_up(self, before: float, schedule: Schedule) -> None:
        """Count answers that are overdue, and go on to what has waited behind them."""
        for client in self._clients:
            if client.sent is not None and client.sent < before:
                due, sent = client.due.popleft(), client.sent
                client.close()
                client.sent, client.free = None, self._clock()
                outcomes = self._outcomes(due, schedule)
                if outcomes is not None:
                    outcomes.timeouts += 1
                    outcomes.latency.record(client.free - due)
                    outcomes.round_trip.record(client.free - sent)
            self._send(client, schedule)

    def _record_unsent(self, schedule: Schedule) -> None:
        now = self._clock()
        for client in self._clients:
            while client.due:
                due = client.due.popleft()
                outcomes = self._outcomes(due, schedule)
                if outcomes is not None:
                    outcomes.unsent += 1
                    outcomes.latency.record(now - due)
            client.sent = None

    def _outcomes(self, due: float, schedule: Schedule) -> Outcomes | None:
        """The window of a request; None while the service warms up."""
        if due < schedule.measure:
            return None
        index = int((due - schedule.measure) / self._window)
        while len(self.windows) <= index:
            self.windows.append(Outcomes())
        return self.windows[index]


class _Client:
    """One connection, the request on its way, and those due behind it."""

    def __init__(self, address: tuple[str, int], first: int) -> None:
        self._address = address
        self.next = first
        self.due: deque[float] = deque()
        self.sent: float | None = None
        self.free = 0.0
        self.socket: socket.socket | None = None
        self.decoder = FrameDecoder()
        self.open()

    def open(self) -> socket.socket:
        """The connection, made anew where it is gone; on loopback that takes no time."""
        if self.socket is None:
            self.socket = socket.create_connection(self._address, timeout=TIMEOUT_S)
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.decoder = FrameDecoder()
        return self.socket

    def close(self) -> None:
        if self.socket is not None:
            with contextlib.suppress(OSError):
                self.socket.close()
            self.socket = None
