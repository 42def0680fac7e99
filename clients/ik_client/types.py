"""What passes through the teleop loop, and the interfaces of the parts around it.

Joint vectors are in wire order (`IKClient.info()` lists the names). Poses are `T_pelvis_wrist`: 4x4, metres, pelvis
frame (x forward, y left, z up). Times are those of the loop's clock [s]; nothing compares the clocks of two machines.
"""

from dataclasses import dataclass
from typing import Protocol

from ik_proto import Array, Collision, Mode, SolveReply


@dataclass(frozen=True, slots=True, eq=False)
class WristTargets:
    """Where a tracker wants the wrists.

    Attributes:
        left: Target of the left wrist, shape (4, 4) [m].
        right: Target of the right wrist, shape (4, 4) [m].
        time: When they were captured [s].
        valid: Whether the tracker vouches for them; the loop holds where it does not.
        left_elbow: Direction from the left shoulder to the left elbow and the confidence in it, shape (4,), as in
            `IKClient.solve`; None where the tracker does not see it.
        right_elbow: The same of the right arm.
        weights: Factors on how much each target counts, shape (2, 2), as in `IKClient.solve`; None for ones.
    """

    left: Array
    right: Array
    time: float
    valid: bool = True
    left_elbow: Array | None = None
    right_elbow: Array | None = None
    weights: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class RobotState:
    """What the robot measures.

    Attributes:
        q: Joint positions, shape (n,) [rad].
        dq: Joint velocities, shape (n,) [rad/s].
        time: When they were measured [s].
        waist: Positions of the waist joints, shape (w,) [rad], in the order of `InfoReply.waist_joints`; None where the
            waist stays straight.
    """

    q: Array
    dq: Array
    time: float
    waist: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """What the robot shall do. Its arrays are read-only.

    Attributes:
        q: Joint positions, shape (n,) [rad].
        tau: Feed-forward torque, shape (n,) [N m].
        time: When it was decided [s].
    """

    q: Array
    tau: Array
    time: float


class RobotPort(Protocol):
    """A robot, real or simulated."""

    def read(self) -> RobotState:
        """Read the latest measurement, without waiting for a new one."""
        ...

    def send(self, command: Command) -> None:
        """Hand over a command, without waiting for its execution."""
        ...


class TargetSource(Protocol):
    """A tracker: a headset, a camera, a script, a recording."""

    def targets(self, now: float) -> WristTargets | None:
        """Say where the wrists shall be.

        Args:
            now: Time of the tick [s].

        Returns:
            The targets, or None where there are none.
        """
        ...


class Solver(Protocol):
    """What the loop needs of an `IKClient`."""

    def solve(
        self,
        left_wrist: Array,
        right_wrist: Array,
        q: Array,
        dq: Array,
        *,
        mode: Mode | None = None,
        waist: Array | None = None,
        left_elbow: Array | None = None,
        right_elbow: Array | None = None,
        weights: Array | None = None,
        collision: Collision | None = None,
    ) -> SolveReply:
        """Find joint positions for two wrist targets; see `IKClient.solve`."""
        ...


class Limiter(Protocol):
    """Bounds how fast commands change. The last link before the robot port."""

    def limit(self, q_last: Array, q_wanted: Array) -> Array:
        """Move from the last command towards the wanted joints.

        Args:
            q_last: Last command, shape (n,) [rad], finite.
            q_wanted: Where to go, shape (n,) [rad].

        Returns:
            The next command, shape (n,) [rad], finite. A new array.
        """
        ...
