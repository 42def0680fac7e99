"""What one tick of the teleop loop did, for displays, logs and tests."""

from dataclasses import dataclass
from enum import StrEnum

from ik_client.engagement import ArmStep
from ik_client.types import Command, RobotState
from ik_proto import Array, SolveReply, Status


class LoopState(StrEnum):
    """What the loop does."""

    TRACKING = "tracking"
    HOLDING = "holding"


class Seed(StrEnum):
    """Where a solve started."""

    COMMAND = "command"
    MEASURED = "measured"
    FOUND = "found"


@dataclass(frozen=True, slots=True, eq=False)
class TickReport:
    """What one tick did.

    Attributes:
        time: When it began [s].
        state: Whether an arm followed a hand, or both came to rest and held.
        reason: Why they held, in words that stay the same while the cause does; empty while tracking.
        command: What was sent to the robot.
        arms: What became of the left and of the right hand.
        measured: What the robot measured; None where it could not be read.
        reply: The service's answer; None where there was none.
        round_trip: How long the solve call took, successful or not [s]; None where none was made.
        seed: Where the solve started; None where none was made.
        fault: The exception that made it hold, if it was one.
    """

    time: float
    state: LoopState
    reason: str
    command: Command
    arms: tuple[ArmStep, ArmStep]
    measured: RobotState | None = None
    reply: SolveReply | None = None
    round_trip: float | None = None
    seed: Seed | None = None
    fault: Exception | None = None

    @property
    def targets(self) -> tuple[Array | None, Array | None]:
        """Target of each wrist, `T_pelvis_wrist`, shape (4, 4) [m]; None where the arm follows no hand."""
        left, right = self.arms
        return left.target, right.target

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
