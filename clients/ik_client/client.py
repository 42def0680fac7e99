"""`IKClient`: one class to call the service, whatever carries the call.

- Every call is bounded by `timeout`, reconnecting and failing over included; a batch by `timeout` and 2 ms more a row.
- An answer (`ok`, `unreachable`, `blocked`, `not_converged`) is returned as an object; a refusal is raised.
- A solve tells the service how long its answer is worth having, so that nothing is solved for a caller who has given
  up.
- A request is validated here as the service would, so that a mistake costs no round trip.
- Not thread-safe: give each thread a client of its own.
"""

import itertools
import secrets
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self, TypeVar

import numpy as np

from ik_client.access import Access, File
from ik_client.address import parse_address
from ik_client.arguments import check_times, size, validated, width
from ik_client.errors import BadRequest, ProtocolMismatch, Refused, ServiceTimeout, ServiceUnavailable, Unauthorized
from ik_client.transport import Transport, open_transport
from ik_proto import (
    ANSWERS,
    MAX_BATCH,
    PROTOCOL_VERSION,
    Array,
    BatchReply,
    ClearanceReply,
    ClearanceRequest,
    Collision,
    Document,
    FkReply,
    FkRequest,
    Frame,
    InfoReply,
    InfoRequest,
    Law,
    Mode,
    ProtocolError,
    Reply,
    ReplyError,
    Request,
    SolveBatchRequest,
    SolveReply,
    SolveRequest,
    Status,
    VelocityReply,
    VelocityRequest,
    parse_batch_reply,
    parse_clearance_reply,
    parse_fk_reply,
    parse_info_reply,
    parse_solve_reply,
    parse_velocity_reply,
    request_document,
)
from ik_proto.limits import (
    DEFAULT_ACCELERATION,
    DEFAULT_DAMPING,
    DEFAULT_PERIOD,
    DEFAULT_POSTURE_GAIN,
    DEFAULT_SPEED,
    DEFAULT_STARTS,
    MAX_BUDGET_MS,
    MAX_STREAM_CHARACTERS,
)

_CLIENT_AT_FAULT = frozenset({Status.BAD_REQUEST, Status.UNSUPPORTED})
_RETRY_PAUSE = 0.05
"""Between two attempts to reach a service that is just starting [s]."""
_ROW_SECONDS = 0.002
"""What a row adds to the time a batch may take [s]: many times what solving and carrying it takes."""
_LONGEST_BUDGET = MAX_BUDGET_MS * 1e-3

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
        token: str | None = None,
        ca: File | None = None,
        cert: File | None = None,
        key: File | None = None,
        zenoh_config: File | None = None,
        stream: str = "",
        budget: float | None = None,
        connect: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Connect and ask who is there.

        Args:
            url: `tcp://HOST:PORT`, `tls://HOST:PORT`, `zenoh://HOST:PORT` or `zenoh://HOST:PORT/ROBOT`.
            timeout: How long a call may take [s]. In a control loop, less than a tick.
            connect_timeout: How long to wait here for a service that is just starting [s].
            preset: Cost to minimise; None takes the service's default.
            token: The secret of a service that demands one; None takes that of the environment variable `IK_TOKEN`.
            ca: PEM file with the authority of a `tls://` service's certificate; None trusts the system's authorities.
            cert: PEM file with this client's certificate, for a `tls://` service that demands one.
            key: PEM file with its private key; None where `cert` holds it too.
            zenoh_config: Zenoh configuration (JSON5) that a `zenoh://` client passes through: TLS, user, password.
            stream: Name of this client's solves, of which only the newest matters: an older one that still waits at
                the service when a newer comes is answered `superseded`. Empty where each matters.
            budget: How long the answer of a solve is worth having [s], counted from its arrival at the service, which
                answers `expired` later on; at most 10. None takes as long as the call may take.
            connect: False leaves connecting to the first call, and asks nothing.
            clock: Monotonic time [s].

        Raises:
            ValueError: The address, a time or a name makes no sense, or a certificate or configuration cannot be read.
            ServiceUnavailable: Nobody answers at the address.
            ServiceTimeout: Somebody is there, and does not answer.
            Unauthorized: The service demands a token, and got none or a wrong one.
            ProtocolMismatch: What answers does not speak this protocol.
        """
        check_times(timeout, connect_timeout, budget, _LONGEST_BUDGET)
        if len(stream) > MAX_STREAM_CHARACTERS:
            raise ValueError(f"stream must have at most {MAX_STREAM_CHARACTERS} characters, not {len(stream)}")
        self.url = url
        self.timeout = timeout
        self._preset = preset
        self._clock = clock
        self._stream = stream
        self._budget = budget
        access = Access.of(token, ca, cert, key, zenoh_config)
        self._transport: Transport | None = open_transport(parse_address(url), clock, access)
        self._token = access.token
        self._ids = itertools.count(1 + secrets.randbelow(2**32))  # a recorded reply fits no other client
        self._widths: tuple[int, int] | None = None
        self._boot_id = ""
        if connect:
            self._connect(connect_timeout)

    @property
    def boot_id(self) -> str:
        """The run of the service that answered last; a changed one means another run. Empty before any answer."""
        return self._boot_id

    def solve(
        self,
        left_wrist: Array,
        right_wrist: Array,
        q: Array,
        dq: Array | None = None,
        *,
        mode: Mode | None = None,
        waist: Array | None = None,
        left_elbow: Array | None = None,
        right_elbow: Array | None = None,
        weights: Array | None = None,
        collision: Collision | None = None,
        starts: int | None = None,
    ) -> SolveReply:
        """Find joint positions that bring both wrists to their targets.

        Args:
            left_wrist: Target of the left wrist `T_pelvis_wrist`, shape (4, 4) [m].
            right_wrist: Target of the right wrist, shape (4, 4) [m].
            q: Joint positions to start from and to stay near, shape (n,) [rad].
            dq: Joint velocities, shape (n,) [rad/s]; zero where not given.
            mode: "track" to stay near `q`, which is the default, or "reach" to search the whole range of the joints.
            waist: Measured waist joints, shape (w,) [rad]; zero where not given. Targets stay in the pelvis frame.
            left_elbow: Wished direction from the left shoulder to the left elbow in the pelvis frame, of any length,
                and the confidence in it from 0 to 1, shape (4,).
            right_elbow: The same of the right arm.
            weights: Factors from 0 to 1 on how much position and rotation of the left and of the right wrist count,
                shape (2, 2): a rotation factor of 0 leaves the orientation free.
            collision: "off", "report" to measure the clearance, or "avoid" to keep it; None takes the service's
                default.
            starts: Most starts an arm is given in mode "reach"; None takes the protocol's default.

        Returns:
            The answer. Follow its `sol_q` only where `success` is true.

        Raises:
            BadRequest: The arguments are at fault; found here where possible.
            Refused: The service cannot serve the request now; or did not solve it because it was too late (`expired`)
                or a newer one of its stream had come (`superseded`).
            Unauthorized: The service demands a token, and got none or a wrong one.
            ServiceUnavailable: Nobody answers at the address.
            ServiceTimeout: No answer came in time.
            ProtocolMismatch: What answers does not speak this protocol.
        """
        n, n_waist = self._joints(size(q), size(waist))
        request = SolveRequest(
            left_wrist,
            right_wrist,
            q,
            np.zeros(n) if dq is None else dq,
            self._preset,
            next(self._ids),
            "track" if mode is None else mode,
            waist,
            left_elbow,
            right_elbow,
            weights,
            collision,
            DEFAULT_STARTS if starts is None else starts,
        )
        return self._call(
            request,
            n,
            n_waist,
            SolveReply,
            lambda document: parse_solve_reply(document, n),
            self.timeout,
            self._envelope(self.timeout),
        )

    def solve_batch(
        self,
        left_wrist: Array,
        right_wrist: Array,
        q: Array,
        dq: Array | None = None,
        *,
        mode: Mode | None = None,
        waist: Array | None = None,
        left_elbow: Array | None = None,
        right_elbow: Array | None = None,
        weights: Array | None = None,
        collision: Collision | None = None,
        starts: int | None = None,
    ) -> BatchReply:
        """Solve N problems in one request; the answers are those of N calls of `solve`, to the last bit.

        The call may take `timeout`, and 2 ms more a row.

        Args:
            left_wrist: Targets of the left wrist, shape (N, 4, 4) [m]; N at most `ik_proto.MAX_BATCH`.
            right_wrist: Targets of the right wrist, shape (N, 4, 4) [m].
            q: Joint positions to start from and to stay near, shape (N, n) [rad].
            dq: Joint velocities, shape (N, n) [rad/s]; zero where not given.
            mode: As in `solve`, for all rows.
            waist: Measured waist joints, shape (N, w) [rad].
            left_elbow: Wished directions and confidences, shape (N, 4).
            right_elbow: The same of the right arm.
            weights: Factors, shape (N, 2, 2).
            collision: As in `solve`, for all rows.
            starts: As in `solve`, for all rows.

        Returns:
            The answers. Where `success` is false, follow the rows whose status in `statuses` is a success.

        Raises:
            IKError: As `solve`. A single bad row refuses the batch, and is named.
        """
        n, n_waist = self._joints(width(q), width(waist))
        request = SolveBatchRequest(
            left_wrist,
            right_wrist,
            q,
            dq,
            self._preset,
            next(self._ids),
            "track" if mode is None else mode,
            waist,
            left_elbow,
            right_elbow,
            weights,
            collision,
            DEFAULT_STARTS if starts is None else starts,
        )
        rows = min(size(q), MAX_BATCH)
        timeout = self.timeout + _ROW_SECONDS * rows
        return self._call(
            request,
            n,
            n_waist,
            BatchReply,
            lambda document: parse_batch_reply(document, rows, n),
            timeout,
            self._envelope(timeout),
        )

    def fk(self, q: Array, waist: Array | None = None) -> FkReply:
        """Ask where the wrists are.

        Args:
            q: Joint positions, shape (n,) [rad].
            waist: Measured waist joints, shape (w,) [rad]; zero where not given.

        Returns:
            Both wrist poses.

        Raises:
            IKError: As `solve`.
        """
        n, n_waist = self._joints(size(q), size(waist))
        return self._call(FkRequest(q, next(self._ids), waist), n, n_waist, FkReply, parse_fk_reply, self.timeout)

    def clearance(self, q: Array, waist: Array | None = None) -> ClearanceReply:
        """Ask how clear of itself the body is in some postures.

        Args:
            q: Joint positions, shape (k, n) [rad]; k at most `ik_proto.MAX_POSTURES`.
            waist: Measured waist joints, the same for all, shape (w,) [rad]; zero where not given.

        Returns:
            The clearance of each.

        Raises:
            IKError: As `solve`.
        """
        n, n_waist = self._joints(width(q), size(waist))
        rows = size(q)
        return self._call(
            ClearanceRequest(q, next(self._ids), waist),
            n,
            n_waist,
            ClearanceReply,
            lambda document: parse_clearance_reply(document, rows),
            self.timeout,
        )

    def velocity(
        self,
        left_twist: Array,
        right_twist: Array,
        q: Array,
        dq: Array | None = None,
        *,
        frame: Frame = "pelvis",
        law: Law = "adaptive",
        hold: tuple[bool, bool] = (True, True),
        damping: float = DEFAULT_DAMPING,
        max_speed: float = DEFAULT_SPEED,
        max_acceleration: float = DEFAULT_ACCELERATION,
        period: float = DEFAULT_PERIOD,
        posture: Array | None = None,
        posture_gain: float = DEFAULT_POSTURE_GAIN,
        left_bounds: Array | None = None,
        right_bounds: Array | None = None,
        waist: Array | None = None,
        collision: Collision | None = None,
    ) -> VelocityReply:
        """Find the joint velocities that give both wrists their twists, as far as nothing limits them.

        Args:
            left_twist: Linear [m/s] and angular velocity [rad/s] of the left wrist, shape (6,); shape (3,) for the
                linear velocity with no rotation wanted.
            right_twist: The same of the right wrist.
            q: Joint positions as last commanded, shape (n,) [rad].
            dq: Joint velocities as last commanded, shape (n,) [rad/s]; without them the acceleration is not bounded,
                and the hand drifts off its path where it goes on for long.
            frame: "pelvis", or "hand" for twists along the axes of each hand.
            law: "adaptive", or "fixed" for the damped pseudoinverse with the orientation left free.
            hold: Whether the orientation of the left and of the right hand is controlled; else it is left free.
            damping: Of the fixed law, and the largest of the adaptive one.
            max_speed: Largest speed of a joint [rad/s].
            max_acceleration: Largest change of a joint's speed [rad/s^2].
            period: Time until the next call [s]; the answer is right for its middle.
            posture: Joint positions to lean towards where the hands leave the choice, shape (n,) [rad].
            posture_gain: Share of the way there that is made in a second [1/s].
            left_bounds: Smallest and largest coordinates of the left wrist in the pelvis frame, shape (2, 3) [m].
            right_bounds: The same of the right wrist.
            waist: Measured waist joints, shape (w,) [rad]; zero where not given.
            collision: As in `solve`.

        Returns:
            The velocities, and what limits them. Without an answer, slow down to zero.

        Raises:
            IKError: As `solve`.
        """
        n, n_waist = self._joints(size(q), size(waist))
        request = VelocityRequest(
            left_twist,
            right_twist,
            q,
            dq,
            next(self._ids),
            frame,
            law,
            *hold,
            damping,
            max_speed,
            max_acceleration,
            period,
            posture,
            posture_gain,
            left_bounds,
            right_bounds,
            waist,
            collision,
        )
        return self._call(
            request,
            n,
            n_waist,
            VelocityReply,
            lambda document: parse_velocity_reply(document, n),
            self.timeout,
            self._envelope(self.timeout),
        )

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
        reply = self._call(InfoRequest(next(self._ids)), 0, 0, InfoReply, parse_info_reply, timeout)
        if reply.protocol != PROTOCOL_VERSION:
            raise ProtocolMismatch(
                self.url, f"it serves version {reply.protocol}, this client speaks version {PROTOCOL_VERSION}"
            )
        self._widths = len(reply.joint_names), len(reply.waist_joints)
        return reply

    def _joints(self, n: int, n_waist: int) -> tuple[int, int]:
        """Numbers of arm and waist joints of the robot; until the service was asked, those of the request."""
        return self._widths or (n, n_waist)

    def _envelope(self, timeout: float) -> Document:
        """How the service shall treat a solve that may take so long [s]."""
        budget = timeout if self._budget is None else self._budget
        envelope: Document = {"budget_ms": 1e3 * budget} if budget <= _LONGEST_BUDGET else {}
        if self._stream:
            envelope["stream"] = self._stream
        return envelope

    def _call(
        self,
        request: Request,
        n: int,
        n_waist: int,
        kind: type[_R],
        parse: Callable[[Document], _R],
        timeout: float,
        envelope: Document | None = None,
    ) -> _R:
        if self._transport is None:
            raise ServiceUnavailable(self.url, "this client is closed; make a new one")
        deadline = self._clock() + timeout
        asked = validated(request_document(request), n, n_waist)
        if envelope:
            asked |= envelope
        if self._token and not self._transport.shows_token:
            asked["token"] = self._token
        body = self._transport.codec.encode(asked)
        try:
            document = self._transport.codec.decode(self._transport.request(body, deadline))
            # Whatever was asked, a refusal has the form of a solve reply.
            reply = parse(document) if document.get("status") in ANSWERS else parse_solve_reply(document, n)
            answered = reply.status in ANSWERS
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
        if reply.status is Status.UNAUTHORIZED:
            raise Unauthorized(bool(self._token), reply)
        raise (BadRequest if reply.status in _CLIENT_AT_FAULT else Refused)(reply.status, reply.error, reply)
