"""What the teleop loop learns during a tick, and the reasons for which it cannot follow."""

import numpy as np

from ik_client.engagement import ArmStep
from ik_client.errors import ServiceTimeout, ServiceUnavailable
from ik_client.steady_waist import SteadyWaist
from ik_client.tick_report import LoopState, Seed, TickReport
from ik_client.types import Command, Hands, RobotPort, RobotState
from ik_proto import Array, SolveReply

NO_HANDS = Hands(None, None)

NO_STEP = 1e-6
"""Step of a joint in a tick that is none [rad]."""

NO_TORQUE = 1e-3
"""Change of a torque in a tick that is none [N m]."""


class Hold(Exception):
    """Why a tick cannot follow, in one line."""


class Tick:
    """A tick under way; becomes its report.

    Attributes:
        time: When it began [s].
        measured: What the robot measured; None where it could not be read.
        waist: Where its waist stands, without its swing, shape (w,) [rad]; None where it stays straight.
        hands: What the tracker saw.
        reply: The service's answer.
        round_trip: How long the solve call took [s].
        seed: Where the solve started.
        reason: The first thing that went wrong, in one line; empty where nothing did.
        fault: The exception it was, if it was one.
    """

    def __init__(self, now: float) -> None:
        """Begin to learn."""
        self.time = now
        self.measured: RobotState | None = None
        self.waist: Array | None = None
        self.hands = NO_HANDS
        self.reply: SolveReply | None = None
        self.round_trip: float | None = None
        self.seed: Seed | None = None
        self.reason = ""
        self.fault: Exception | None = None

    def note(self, error: Exception) -> str:
        """Keep the first thing that went wrong; give it in one line."""
        text = one_line(error)
        if not self.reason:
            self.reason, self.fault = text, None if isinstance(error, Hold) else error
        return text

    def read(self, port: RobotPort, waist: SteadyWaist, n: int) -> str:
        """Read the robot, unless that was done.

        Args:
            port: The robot.
            waist: What takes the swing out of its waist.
            n: How many joints it has.

        Returns:
            What is wrong, in one line; empty where nothing is.
        """
        try:
            measured = self.measured or port.read()
            usable(measured.q, n, "the measured joints")
            usable(measured.dq, n, "the measured velocities")
            self.measured, self.waist = measured, waist.update(measured.waist, self.time)
        except Exception as error:  # whatever a driver raises, the robot must be told to hold in this very tick
            self.measured = None
            return self.note(error)
        return ""

    def report(self, arms: tuple[ArmStep, ArmStep], command: Command, tracking: bool, why_held: str) -> TickReport:
        """What the tick did.

        Args:
            arms: What became of both hands.
            command: What was sent.
            tracking: Whether an arm followed.
            why_held: Why not, where nothing went wrong in this tick.
        """
        return TickReport(
            time=self.time,
            state=LoopState.TRACKING if tracking else LoopState.HOLDING,
            reason="" if tracking else self.reason or why_held,
            command=command,
            arms=arms,
            measured=self.measured,
            reply=self.reply,
            round_trip=self.round_trip,
            seed=self.seed,
            fault=self.fault,
        )


def usable(vector: Array | None, n: int, what: str) -> Array:
    """The vector itself where it has n finite entries.

    Raises:
        Hold: It has not.
    """
    if vector is None or not is_finite(vector, n):
        raise Hold(f"{what} must be {n} finite numbers and are not")
    return vector


def is_finite(vector: Array, n: int) -> bool:
    """Whether something is a vector of n finite numbers."""
    return np.shape(vector) == (n,) and bool(np.isfinite(vector).all())


def is_silence(error: Exception) -> bool:
    """Whether an error says that nothing was heard of the service."""
    return isinstance(error, ServiceUnavailable | ServiceTimeout)


def one_line(error: Exception) -> str:
    """An error as a reason; that of the loop's own in its own words."""
    text = " ".join(str(error).split())
    if isinstance(error, Hold):
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def first_command(measured: RobotState, now: float) -> Command:
    """Where the robot holds its joints, or where they are; not to be sent.

    Raises:
        ValueError: That is no finite joint vector.
    """
    q = np.array(measured.q if measured.q_set is None else measured.q_set, dtype=np.float64)
    if q.ndim != 1 or not np.isfinite(q).all():
        raise ValueError("the robot's first measurement is not a finite joint vector, so there is nothing to hold")
    held = measured.tau_set
    tau = np.array(held, dtype=np.float64) if held is not None and is_finite(held, len(q)) else np.zeros(len(q))
    return Command(frozen(q), frozen(tau), now)


def resting_goal(measured: RobotState | None, last: Command) -> Array:
    """The goal of a tick that follows nothing: rest (NaN), or where the robot's end holds its joints [rad]."""
    if measured is None or measured.q_set is None or measured.following or last.engaged:
        return np.full(len(last.q), np.nan)
    return measured.q_set


def is_same(command: Command, last: Command) -> bool:
    """Whether a command changes nothing of the one before."""
    return bool(np.abs(command.q - last.q).max() <= NO_STEP and np.abs(command.tau - last.tau).max() <= NO_TORQUE)


def frozen(vector: Array) -> Array:
    """The vector itself, from now on read-only."""
    vector.flags.writeable = False
    return vector
