"""Request to reply, and nothing else: no transport, no state between requests, time injected.

Every request gets exactly one reply, whatever is wrong with it. A fault of ours becomes the status `internal` with a
plain sentence; its traceback goes to the local log and never over the wire.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ik_proto import (
    Codec,
    DecodeError,
    Document,
    FkReply,
    FkRequest,
    InfoRequest,
    Reply,
    Request,
    RequestError,
    SolveReply,
    SolveRequest,
    Status,
    parse_request,
    reply_document,
)
from ik_proto.smoothing import WeightedMovingFilter
from ik_service.engine import Engine
from ik_service.logs import log
from ik_service.metrics import Meter

_INTERNAL_MESSAGE = "the service failed on this request; its log says why"
_NOT_CONVERGED_MESSAGE = "the solver stopped before the optimum: sol_q is the request's q, hold the last command"


class Service:
    """Answers requests with one engine.

    The engine's solvers own their buffers, so a service belongs to one thread; `Engine.copy` makes another for another
    thread.
    """

    def __init__(self, engine: Engine, meter: Meter, clock: Callable[[], float] = time.perf_counter) -> None:
        """Take what it needs to answer.

        Args:
            engine: Robot, solvers and self-description.
            meter: Counts every reply.
            clock: Monotonic time [s], for the durations in replies and metrics.
        """
        self._engine = engine
        self._meter = meter
        self._clock = clock
        self._boot_id = engine.about.boot_id
        self._nq = engine.robot.nq

    def handle_bytes(self, body: bytes, codec: Codec, smoothing: WeightedMovingFilter | None = None) -> bytes:
        """Answer an encoded request. Never raises.

        Args:
            body: The request as it came.
            codec: How it and its reply are encoded.
            smoothing: A filter the solved joints go through, for clients that expect it.

        Returns:
            The encoded reply.
        """
        started = self._clock()
        try:
            reply = self._handle(codec.decode(body), started, smoothing)
        except DecodeError as error:
            reply = self.refusal(Status.BAD_REQUEST, str(error))
        except Exception:
            reply = self._internal_fault()
        encoded = codec.encode(reply_document(reply))
        solved = isinstance(reply, SolveReply) and reply.solve_us > 0.0
        self._meter.record(reply.status, self._clock() - started, reply.solve_us * 1e-6 if solved else None)
        return encoded

    def handle(self, document: Document, smoothing: WeightedMovingFilter | None = None) -> Reply:
        """Answer a decoded request. Never raises for anything the request says.

        Args:
            document: The request.
            smoothing: As in `handle_bytes`.

        Returns:
            The reply.
        """
        return self._handle(document, self._clock(), smoothing)

    def _handle(self, document: Document, started: float, smoothing: WeightedMovingFilter | None) -> Reply:
        try:
            request = parse_request(document, self._nq)
        except RequestError as refusal:
            return self.refusal(refusal.status, str(refusal), refusal.id, refusal.q)
        try:
            return self._answer(request, started, smoothing)
        except Exception:
            return self._internal_fault(request.id, None if isinstance(request, InfoRequest) else request.q)

    def refusal(self, status: Status, message: str, id: int = 0, q: np.ndarray | None = None) -> SolveReply:
        """Say no in the form every client understands.

        Args:
            status: Why, for a machine.
            message: Why, for a person, in one line.
            id: The request's id where it is known.
            q: The request's joint positions where they are known [rad].

        Returns:
            A reply with `success` false.
        """
        return SolveReply(success=False, error=message, status=status, id=id, boot_id=self._boot_id, sol_q=q)

    def refuse_bytes(self, status: Status, message: str, codec: Codec) -> bytes:
        """Encode and count a refusal for which there is no readable request."""
        self._meter.record(status, 0.0, None)
        return codec.encode(reply_document(self.refusal(status, message)))

    def _answer(self, request: Request, started: float, smoothing: WeightedMovingFilter | None) -> Reply:
        match request:
            case SolveRequest():
                return self._solve(request, started, smoothing)
            case FkRequest():
                left, right = self._engine.robot.fk(request.q)
                return FkReply(
                    success=True,
                    error="",
                    status=Status.OK,
                    id=request.id,
                    boot_id=self._boot_id,
                    left_wrist=left,
                    right_wrist=right,
                )
            case InfoRequest():
                return replace(self._engine.about, id=request.id)

    def _solve(self, request: SolveRequest, started: float, smoothing: WeightedMovingFilter | None) -> SolveReply:
        solvers = self._engine.solvers
        name = request.preset or self._engine.about.default_preset
        solver = solvers.get(name)
        if solver is None:
            message = f"preset {name[:40]!r} is not served, there are {', '.join(sorted(solvers))}"
            return self.refusal(Status.UNSUPPORTED, message, request.id, request.q)
        # The clock is read four times a request and no more: under load a reading costs as much as a small array.
        before = self._clock()
        solution = solver.solve(request.left_wrist, request.right_wrist, request.q)
        after = self._clock()
        if solution.status.success and smoothing is not None:
            solution = self._engine.smoothed(solution, request, smoothing)
        success = solution.status.success
        return SolveReply(
            success=success,
            error="" if success else _NOT_CONVERGED_MESSAGE,
            status=solution.status,
            id=request.id,
            boot_id=self._boot_id,
            sol_q=solution.q,
            tau=solution.tau if success else None,
            position_error=solution.position_error if success else None,
            rotation_error=solution.rotation_error if success else None,
            iterations=solution.iterations,
            solve_us=(after - before) * 1e6,
            server_us=(after - started) * 1e6,
        )

    def _internal_fault(self, id: int = 0, q: np.ndarray | None = None) -> SolveReply:
        """Log the exception being handled and make its reply."""
        log.exception("request failed")
        return self.refusal(Status.INTERNAL, _INTERNAL_MESSAGE, id, q)
