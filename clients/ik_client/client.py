"""`IKClient`: one class to call the service, whatever carries the call.

- Every call is bounded by `timeout`, reconnecting and failing over included.
- An answer (`ok`, `unreachable`, `not_converged`) is returned as an object; a refusal is raised.
- A request is validated here as the service would, so that a mistake costs no round trip.
- Not thread-safe: give each thread a client of its own.
"""

import itertools
import math
import time
from collections.abc import Callable, Sized
from types import TracebackType
from typing import Self, TypeVar

import numpy as np

from ik_client.address import parse_address
from ik_client.errors import BadRequest, ProtocolMismatch, Refused, ServiceTimeout, ServiceUnavailable
from ik_client.transport import Transport, open_transport
from ik_proto import (
    PROTOCOL_VERSION,
    Array,
    Document,
    FkReply,
    FkRequest,
    InfoReply,
    InfoRequest,
    ProtocolError,
    Reply,
    ReplyError,
    Request,
    RequestError,
    SolveReply,
    SolveRequest,
    Status,
    parse_fk_reply,
    parse_info_reply,
    parse_request,
    parse_solve_reply,
    request_document,
)

_ANSWERS = frozenset({Status.OK, Status.UNREACHABLE, Status.NOT_CONVERGED})
_CLIENT_AT_FAULT = frozenset({Status.BAD_REQUEST, Status.UNSUPPORTED})
_RETRY_PAUSE = 0.05
"""Between two attempts to reach a service that is just starting [s]."""

_R = TypeVar("_R", bound=Reply)


class IKClient:
    """A client of one service.

    Example:
        with IKClient("tcp://127.0.0.1:12345") as ik:
            reply = ik.solve(T_pelvis_left, T_pelvis_right, q)

    Attributes:
        url: The service's address.
        timeout: How long a call may take [s].
    """

    def __init__(
        self,
        url: str,
        *,
        timeout: float = 0.1,
        connect_timeout: float = 2.0,
        preset: str | None = None,
        connect: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Connect and ask who is there.

        Args:
            url: `tcp://HOST:PORT`, `zenoh://HOST:PORT` or `zenoh://HOST:PORT/ROBOT`.
            timeout: How long a call may take [s]. In a control loop, less than a tick.
            connect_timeout: How long to wait here for a service that is just starting [s].
            preset: Cost to minimise; None takes the service's default.
            connect: False leaves connecting to the first call, and asks nothing.
            clock: Monotonic time [s].

        Raises:
            ValueError: The address or a timeout makes no sense.
            ServiceUnavailable: Nobody answers at the address.
            ServiceTimeout: Somebody is there, and does not answer.
            ProtocolMismatch: What answers does not speak this protocol.
        """
        for name, value in (("timeout", timeout), ("connect_timeout", connect_timeout)):
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number of seconds, not {value}")
        self.url = url
        self.timeout = timeout
        self._preset = preset
        self._clock = clock
        self._transport: Transport | None = open_transport(parse_address(url), clock)
        self._ids = itertools.count(1)
        self._n: int | None = None
        self._boot_id = ""
        if connect:
            self._connect(connect_timeout)

    @property
    def boot_id(self) -> str:
        """The run of the service that answered last; a changed one means another run. Empty before any answer."""
        return self._boot_id

    def solve(self, left_wrist: Array, right_wrist: Array, q: Array, dq: Array | None = None) -> SolveReply:
        """Find joint positions that bring both wrists to their targets.

        Args:
            left_wrist: Target of the left wrist `T_pelvis_wrist`, shape (4, 4) [m].
            right_wrist: Target of the right wrist, shape (4, 4) [m].
            q: Joint positions to start from and to stay near, shape (n,) [rad].
            dq: Joint velocities, shape (n,) [rad/s]; zero where not given.

        Returns:
            The answer. Follow its `sol_q` only where `success` is true.

        Raises:
            BadRequest: The arguments are at fault; found here where possible.
            Refused: The service cannot serve the request now.
            ServiceUnavailable: Nobody answers at the address.
            ServiceTimeout: No answer came in time.
            ProtocolMismatch: What answers does not speak this protocol.
        """
        n = self._joints(q)
        dq = np.zeros(n) if dq is None else dq
        request = SolveRequest(left_wrist, right_wrist, q, dq, self._preset, next(self._ids))
        return self._call(request, n, SolveReply, lambda document: parse_solve_reply(document, n), self.timeout)

    def fk(self, q: Array) -> FkReply:
        """Ask where the wrists are.

        Args:
            q: Joint positions, shape (n,) [rad].

        Returns:
            Both wrist poses.

        Raises:
            IKError: As `solve`.
        """
        return self._call(FkRequest(q, next(self._ids)), self._joints(q), FkReply, parse_fk_reply, self.timeout)

    def info(self) -> InfoReply:
        """Ask who answers: protocol, robot, joint order, limits, presets.

        Returns:
            What the service says about itself.

        Raises:
            IKError: As `solve`.
        """
        return self._info(self.timeout)

    def close(self) -> None:
        """Let go of the connection; the client cannot be used again."""
        if self._transport is not None:
            self._transport.close()
            self._transport = None

    def __enter__(self) -> Self:
        """Use the client in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self.close()

    def _connect(self, connect_timeout: float) -> None:
        """Repeat the first question until somebody answers it."""
        end = self._clock() + connect_timeout
        try:
            while True:
                try:
                    self._info(max(end - self._clock(), _RETRY_PAUSE))
                    return
                except ServiceUnavailable:
                    if self._clock() + _RETRY_PAUSE > end:
                        raise
                    time.sleep(_RETRY_PAUSE)
        except BaseException:
            self.close()
            raise

    def _info(self, timeout: float) -> InfoReply:
        reply = self._call(InfoRequest(next(self._ids)), 0, InfoReply, parse_info_reply, timeout)
        if reply.protocol != PROTOCOL_VERSION:
            raise ProtocolMismatch(
                self.url, f"it serves version {reply.protocol}, this client speaks version {PROTOCOL_VERSION}"
            )
        self._n = len(reply.joint_names)
        return reply

    def _joints(self, q: Array) -> int:
        """Number of joints of the robot; until the service was asked, as many as the request has."""
        if self._n is not None:
            return self._n
        return len(q) if isinstance(q, Sized) else 0

    def _call(self, request: Request, n: int, kind: type[_R], parse: Callable[[Document], _R], timeout: float) -> _R:
        if self._transport is None:
            raise ServiceUnavailable(self.url, "this client is closed; make a new one")
        deadline = self._clock() + timeout
        body = self._transport.codec.encode(_validated(request_document(request), n))
        try:
            document = self._transport.codec.decode(self._transport.request(body, deadline))
            # Whatever was asked, a refusal has the form of a solve reply.
            reply = parse(document) if document.get("success") is True else parse_solve_reply(document, n)
            answered = reply.status in _ANSWERS
            if reply.id != request.id and (answered or reply.id != 0):  # 0: refused before the id could be read
                raise ReplyError(f"reply {reply.id} came for request {request.id}")
        except TimeoutError:
            raise ServiceTimeout(self.url, timeout) from None
        except ProtocolError as error:
            self._transport.reset()
            raise ProtocolMismatch(self.url, str(error)) from None
        self._boot_id = reply.boot_id
        if answered and isinstance(reply, kind):
            return reply
        raise (BadRequest if reply.status in _CLIENT_AT_FAULT else Refused)(reply.status, reply.error, reply)


def _validated(document: Document, n: int) -> Document:
    """The document of a request the service would accept.

    Raises:
        BadRequest: It would not.
    """
    try:
        return request_document(parse_request(document, n))
    except RequestError as error:
        raise BadRequest(error.status, str(error)) from None
