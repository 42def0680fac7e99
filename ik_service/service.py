"""Request to reply, and nothing else: no transport, no state between requests, time injected.

Every request gets exactly one reply, whatever is wrong with it. A fault of ours becomes the status `internal` with a
plain sentence; its traceback goes to the local log and never over the wire.
"""

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ik_proto import (
    BatchReply,
    ClearanceReply,
    ClearanceRequest,
    Codec,
    DecodeError,
    Document,
    FkReply,
    FkRequest,
    InfoRequest,
    Reply,
    Request,
    RequestError,
    SolveBatchRequest,
    SolveReply,
    SolveRequest,
    Status,
    VelocityReply,
    VelocityRequest,
    gravest,
    parse_request,
    reply_document,
)
from ik_proto.smoothing import WeightedMovingFilter
from ik_service.engine import Engine
from ik_service.logs import log
from ik_service.metrics import Meter
from ik_service.solver import Solver

_EXPIRED_MESSAGE = "its budget_ms had run out before it was its turn"
_INTERNAL_MESSAGE = "the service failed on this request; its log says why"
_NOT_CONVERGED_MESSAGE = "the solver stopped before the optimum: sol_q is the request's q, hold the last command"
_BATCH_NOT_CONVERGED_MESSAGE = "{} of {} rows are not converged: where statuses says so, sol_q is the row's q"


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
        self._n_waist = len(engine.robot.waist.joint_names)
        self._slowest_motor = float(np.min(engine.about.velocity))

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
            reply = self._handle(codec.decode(body), started, math.inf, smoothing)
        except DecodeError as error:
            reply = self.refusal(Status.BAD_REQUEST, str(error))
        except Exception:
            reply = self._internal_fault()
        return self._encoded(reply, codec, started)

    def handle_document(
        self,
        document: Document,
        codec: Codec,
        started: float,
        expires: float = math.inf,
        smoothing: WeightedMovingFilter | None = None,
    ) -> bytes:
        """Answer a request that was decoded elsewhere. Never raises.

        Args:
            document: The request.
            codec: How its reply is encoded.
            started: When its bytes came, by the service's clock [s].
            expires: Until when its answer is worth having, by the same clock [s].
            smoothing: As in `handle_bytes`.

        Returns:
            The encoded reply.
        """
        return self._encoded(self._handle(document, started, expires, smoothing), codec, started)

    def handle(self, document: Document, smoothing: WeightedMovingFilter | None = None) -> Reply:
        """Answer a decoded request. Never raises for anything the request says.

        Args:
            document: The request.
            smoothing: As in `handle_bytes`.

        Returns:
            The reply.
        """
        return self._handle(document, self._clock(), math.inf, smoothing)

    def _handle(
        self, document: Document, started: float, expires: float, smoothing: WeightedMovingFilter | None
    ) -> Reply:
        request: Request | None = None
        try:
            request = parse_request(document, self._nq, self._n_waist)
            if expires < math.inf and self._clock() > expires:
                return self.refusal(Status.EXPIRED, _EXPIRED_MESSAGE, request.id, _echo(request))
            return self._answer(request, started, smoothing)
        except RequestError as refusal:
            return self.refusal(refusal.status, str(refusal), refusal.id, refusal.q)
        except Exception:
            return self._internal_fault(request)

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

    def refuse_bytes(self, status: Status, message: str, codec: Codec, id: int = 0) -> bytes:
        """Encode and count a refusal of a request that is not looked at any further."""
        self._meter.record(status, 0.0, None)
        return codec.encode(reply_document(self.refusal(status, message, id)))

    def _encoded(self, reply: Reply, codec: Codec, started: float) -> bytes:
        encoded = codec.encode(reply_document(reply))
        solved = isinstance(reply, SolveReply) and reply.solve_us > 0.0
        self._meter.record(reply.status, self._clock() - started, reply.solve_us * 1e-6 if solved else None)
        return encoded

    def _answer(self, request: Request, started: float, smoothing: WeightedMovingFilter | None) -> Reply:
        match request:
            case SolveRequest():
                return self._solve(request, started, smoothing)
            case SolveBatchRequest():
                return self._solve_batch(request, started)
            case FkRequest():
                left, right = self._engine.robot.fk(request.q, request.waist)
                return FkReply(
                    success=True,
                    error="",
                    status=Status.OK,
                    id=request.id,
                    boot_id=self._boot_id,
                    left_wrist=left,
                    right_wrist=right,
                )
            case ClearanceRequest():
                return self._clearance(request)
            case VelocityRequest():
                return self._velocity(request, started)
            case InfoRequest():
                return replace(self._engine.about, id=request.id)

    def _clearance(self, request: ClearanceRequest) -> ClearanceReply:
        clearance, nearest = self._engine.gauge.clearance(request.q, request.waist)
        return ClearanceReply(
            success=True,
            error="",
            status=Status.OK,
            id=request.id,
            boot_id=self._boot_id,
            clearance=clearance if nearest else None,
            nearest=nearest,
        )

    def _velocity(self, request: VelocityRequest, started: float) -> VelocityReply:
        before = self._clock()
        found = self._engine.rate_control.solve(
            request.left_twist,
            request.right_twist,
            request.q,
            request.dq,
            frame=request.frame,
            law=request.law,
            hold=(request.hold_left, request.hold_right),
            damping=request.damping,
            max_speed=min(request.max_speed, self._slowest_motor),
            max_acceleration=request.max_acceleration,
            period=request.period,
            posture=request.posture,
            posture_gain=request.posture_gain,
            left_bounds=request.left_bounds,
            right_bounds=request.right_bounds,
            collision=request.collision or self._engine.collision,
            waist=request.waist,
        )
        after = self._clock()
        return VelocityReply(
            success=True,
            error="",
            status=Status.OK,
            id=request.id,
            boot_id=self._boot_id,
            dq=found.dq,
            twists=found.twists,
            manipulability=found.manipulability,
            damping=found.damping,
            limited_by=found.limited_by,
            limiting_joint=found.limiting_joint,
            clearance=found.clearance if found.nearest else None,
            nearest=found.nearest,
            solve_us=(after - before) * 1e6,
            server_us=(after - started) * 1e6,
        )

    def _solve(self, request: SolveRequest, started: float, smoothing: WeightedMovingFilter | None) -> SolveReply:
        solver, collision = self._solver_for(request), request.collision or self._engine.collision
        # The clock is read four times a request and no more: under load a reading costs as much as a small array.
        before = self._clock()
        solution = solver.solve(
            request.left_wrist,
            request.right_wrist,
            request.q,
            mode=request.mode,
            collision=collision,
            waist=request.waist,
            left_elbow=request.left_elbow,
            right_elbow=request.right_elbow,
            weights=request.weights,
            starts=request.starts,
        )
        after = self._clock()
        if solution.status.success and smoothing is not None:
            solution = self._engine.smoothed(solution, request, collision, smoothing)
        success = solution.status.success
        measured = success and solution.nearest is not None
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
            clearance=solution.clearance if measured else None,
            nearest=solution.nearest if measured else None,
            start=solution.start if success else None,
            starts=solution.starts if success else None,
        )

    def _solve_batch(self, request: SolveBatchRequest, started: float) -> BatchReply:
        solver, collision = self._solver_for(request), request.collision or self._engine.collision
        before = self._clock()
        found = solver.solve_batch(
            request.left_wrist,
            request.right_wrist,
            request.q,
            mode=request.mode,
            collision=collision,
            waist=request.waist,
            left_elbow=request.left_elbow,
            right_elbow=request.right_elbow,
            weights=request.weights,
            starts=request.starts,
        )
        after = self._clock()
        status = gravest(found.statuses)
        failed = sum(not row.success for row in found.statuses)
        return BatchReply(
            success=status.success,
            error=_BATCH_NOT_CONVERGED_MESSAGE.format(failed, len(found.statuses)) if failed else "",
            status=status,
            id=request.id,
            boot_id=self._boot_id,
            sol_q=found.q,
            statuses=found.statuses,
            tau=found.tau,
            position_error=found.position_error,
            rotation_error=found.rotation_error,
            clearance=found.clearance if np.isfinite(found.clearance).all() else None,
            start=found.start.tolist(),
            iterations=found.iterations,
            solve_us=(after - before) * 1e6,
            server_us=(after - started) * 1e6,
        )

    def _solver_for(self, request: SolveRequest | SolveBatchRequest) -> Solver:
        """The solver of the request's preset.

        Raises:
            RequestError: The robot or the service has not what the request asks for.
        """
        if request.left_elbow is not None or request.right_elbow is not None:
            self._require_elbows(request)
        name = request.preset or self._engine.about.default_preset
        solver = self._engine.solvers.get(name)
        if solver is None:
            known = ", ".join(sorted(self._engine.solvers))
            raise _unsupported(request, f"preset {name[:40]!r} is not served, there are {known}")
        return solver

    def _require_elbows(self, request: SolveRequest | SolveBatchRequest) -> None:
        for arm, hint in zip(self._engine.robot.arms, (request.left_elbow, request.right_elbow), strict=True):
            if hint is not None and arm.elbow is None:
                robot = self._engine.robot.name
                raise _unsupported(request, f"{arm.side}_elbow cannot be served: no elbow is named for robot {robot}")

    def _internal_fault(self, request: Request | None = None) -> SolveReply:
        """Log the exception being handled and make its reply."""
        log.exception("request failed")
        return self.refusal(Status.INTERNAL, _INTERNAL_MESSAGE, request.id if request else 0, _echo(request))


def _echo(request: Request | None) -> np.ndarray | None:
    """The joint positions that the reply to a failed request gives back; that of a batch has no room for them."""
    return request.q if isinstance(request, SolveRequest | FkRequest | VelocityRequest) else None


def _unsupported(request: SolveRequest | SolveBatchRequest, message: str) -> RequestError:
    return RequestError(message, Status.UNSUPPORTED, request.id, _echo(request))
