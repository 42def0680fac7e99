"""The teleop loop: targets in, solve, limit, command out, once per tick.

| situation                                                        | state    | command                              |
|------------------------------------------------------------------|----------|--------------------------------------|
| targets valid, answer usable                                     | TRACKING | a limited step towards the answer    |
| no or invalid targets, any error, no success, unusable answer    | HOLDING  | the last one again, bit for bit      |

- A command goes to the robot every tick, whatever happens. Before the first answer it is the measured joints of the
  first tick, without torque. It never goes home by itself.
- The solve starts from the last command while every joint agrees with the measurement within `agreement`, else from the
  measured joints: a solver that starts from a sagging arm creeps after it.
- The measured waist, and the elbow directions and weights a tracker gives, go with every solve.
- Leaving HOLDING needs nothing but a usable answer: the limiter bounds the way from the held command, so a service that
  returns, or another that takes over, cannot make the robot jump.
- The feed-forward torque advances by the same fraction of its way as the joints, and is held with them.
- Only a first tick that cannot read the robot raises: there is nothing to hold yet.

This is not a safety function; the robot side keeps its own watchdog and limiter.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ik_client.types import Command, Limiter, RobotPort, RobotState, Solver, TargetSource, WristTargets
from ik_proto import Array, Collision, SolveReply, Status
from ik_proto.smoothing import WeightedMovingFilter


class LoopState(StrEnum):
    """What the loop does."""

    TRACKING = "tracking"
    HOLDING = "holding"


class Seed(StrEnum):
    """Where a solve started."""

    COMMAND = "command"
    MEASURED = "measured"


@dataclass(frozen=True, slots=True, eq=False)
class TickReport:
    """What one tick did.

    Attributes:
        time: When it began [s].
        state: Whether it followed or held.
        reason: Why it held, in words that stay the same while the cause does; empty while tracking.
        command: What was sent to the robot.
        measured: What the robot measured; None where it could not be read.
        targets: What the tracker wanted; None where it said nothing.
        reply: The service's answer; None where there was none.
        round_trip: How long the solve call took, successful or not [s]; None where none was made.
        seed: Where the solve started; None where none was made.
        fault: The exception that made it hold, if it was one.
    """

    time: float
    state: LoopState
    reason: str
    command: Command
    measured: RobotState | None = None
    targets: WristTargets | None = None
    reply: SolveReply | None = None
    round_trip: float | None = None
    seed: Seed | None = None
    fault: Exception | None = None

    @property
    def status(self) -> Status | None:
        """The answer's status; None without an answer."""
        return self.reply.status if self.reply else None

    @property
    def position_error(self) -> Array | None:
        """Distance of each wrist from its target at the answer, left and right, shape (2,) [m]; None without one."""
        return self.reply.position_error if self.reply else None

    @property
    def rotation_error(self) -> Array | None:
        """Angle between each wrist and its target at the answer, shape (2,) [rad]; None without one."""
        return self.reply.rotation_error if self.reply else None

    @property
    def clearance(self) -> float | None:
        """Smallest distance between two parts of the body at the answer [m]; None where it was not measured."""
        return self.reply.clearance if self.reply else None

    @property
    def solve_us(self) -> float | None:
        """Time the service spent solving [us]; None without an answer."""
        return self.reply.solve_us if self.reply else None

    @property
    def boot_id(self) -> str:
        """The run of the service that answered; empty without an answer."""
        return self.reply.boot_id if self.reply else ""


class _Hold(Exception):
    """Why this tick cannot follow."""


class _Tick:
    """What is learnt during a tick; becomes its report."""

    def __init__(self, now: float) -> None:
        self.time = now
        self.measured: RobotState | None = None
        self.targets: WristTargets | None = None
        self.reply: SolveReply | None = None
        self.round_trip: float | None = None
        self.seed: Seed | None = None


class TeleopLoop:
    """Follows a tracker with a robot's arms through an IK service. One tick per call, paced by the caller."""

    def __init__(
        self,
        ik: Solver,
        source: TargetSource,
        port: RobotPort,
        limiter: Limiter,
        *,
        smoothing: WeightedMovingFilter | None = None,
        feed_forward: bool = False,
        collision: Collision | None = None,
        agreement: float = 0.3,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Put the parts together; nothing moves before the first tick.

        Args:
            ik: An `IKClient`, or anything that solves like it. Its timeout should be shorter than a tick.
            source: The tracker.
            port: The robot.
            limiter: Bounds the way from one command to the next.
            smoothing: Filter over the answers, in front of the limiter.
            feed_forward: Send the gravity torque along with the joints; else the torque is zero.
            collision: What to do about self-collision, as in `IKClient.solve`; None takes the service's default.
            agreement: Largest difference of a joint's command and measurement with which the command still counts as
                where the arm is [rad].
            clock: Monotonic time [s].
        """
        self._ik = ik
        self._source = source
        self._port = port
        self._limiter = limiter
        self._smoothing = smoothing
        self._feed_forward = feed_forward
        self._collision: Collision | None = collision
        self._agreement = agreement
        self._clock = clock
        self._last: Command | None = None

    def tick(self) -> TickReport:
        """Read, solve, limit, send.

        Returns:
            What was done and why.

        Raises:
            Exception: The robot could not be read in the very first tick, or could not be sent a command in this one.
        """
        tick = _Tick(self._clock())
        if self._last is None:
            tick.measured = self._port.read()
            self._last = _first_command(tick.measured, tick.time)
        state, reason, fault = LoopState.TRACKING, "", None
        try:
            q, tau = self._follow(tick, self._last)
        except _Hold as hold:
            state, reason = LoopState.HOLDING, str(hold)
        # Whatever goes wrong in a tracker, a client or a driver, the robot must be told to hold in this very tick.
        except Exception as error:
            state, reason, fault = LoopState.HOLDING, _one_line(error), error
        if state is LoopState.HOLDING:
            q, tau = self._last.q, self._last.tau
        self._last = Command(_frozen(q), _frozen(tau), tick.time)
        self._port.send(self._last)
        return TickReport(
            time=tick.time,
            state=state,
            reason=reason,
            command=self._last,
            measured=tick.measured,
            targets=tick.targets,
            reply=tick.reply,
            round_trip=tick.round_trip,
            seed=tick.seed,
            fault=fault,
        )

    def _follow(self, tick: _Tick, last: Command) -> tuple[Array, Array]:
        """The next command's joints [rad] and torque [N m]; raises where the loop must hold."""
        n = len(last.q)
        measured = tick.measured = tick.measured or self._port.read()
        _usable(measured.q, n, "the measured joints")
        _usable(measured.dq, n, "the measured velocities")
        targets = tick.targets = self._source.targets(tick.time)
        if targets is None:
            raise _Hold("no targets")
        if not targets.valid:
            raise _Hold("targets are not valid")
        reply = tick.reply = self._solve(tick, targets, measured, last)
        if not reply.success:
            raise _Hold(f"{reply.status}: {reply.error}")
        wanted = _usable(reply.sol_q, n, "the answer")
        tau = _usable(reply.tau, n, "the answer's torque") if self._feed_forward else last.tau
        if self._smoothing:
            wanted = self._smoothing(wanted)
        q = self._limiter.limit(last.q, wanted)
        progress = _progress(last.q, q, wanted)
        return q, (1.0 - progress) * last.tau + progress * tau

    def _solve(self, tick: _Tick, targets: WristTargets, measured: RobotState, last: Command) -> SolveReply:
        agrees = bool(np.all(np.abs(last.q - measured.q) <= self._agreement))
        tick.seed = Seed.COMMAND if agrees else Seed.MEASURED
        seed = last.q if agrees else measured.q
        begin = self._clock()
        try:
            return self._ik.solve(
                targets.left,
                targets.right,
                seed,
                measured.dq,
                waist=measured.waist,
                left_elbow=targets.left_elbow,
                right_elbow=targets.right_elbow,
                weights=targets.weights,
                collision=self._collision,
            )
        finally:
            tick.round_trip = self._clock() - begin


def _first_command(measured: RobotState, now: float) -> Command:
    q = np.array(measured.q, dtype=np.float64)
    if q.ndim != 1 or not np.isfinite(q).all():
        raise ValueError("the robot's first measurement is not a finite joint vector, so there is nothing to hold")
    return Command(q, np.zeros(len(q)), now)


def _usable(vector: Array | None, n: int, what: str) -> Array:
    """The vector itself where it has n finite entries; a reason to hold where not."""
    if vector is None or np.shape(vector) != (n,) or not np.isfinite(vector).all():
        raise _Hold(f"{what} must be {n} finite numbers and are not")
    return vector


def _progress(q_last: Array, q_next: Array, q_wanted: Array) -> float:
    """The fraction of the way that a limited step covers, 0 to 1."""
    way = np.max(np.abs(q_wanted - q_last))
    return min(1.0, float(np.max(np.abs(q_next - q_last)) / way)) if way > 0.0 else 1.0


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _frozen(vector: Array) -> Array:
    vector.flags.writeable = False
    return vector
