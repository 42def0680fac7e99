"""What passes through the teleop loop, and the interfaces of the parts around it.

Joint vectors are in wire order (`IKClient.info()` lists the names). Poses are `T_pelvis_wrist`: 4x4, metres, pelvis
frame (x forward, y left, z up). Times are those of the loop's clock [s]; nothing compares the clocks of two machines.
"""

from dataclasses import dataclass
from typing import Protocol

from ik_client.hand import HandSample
from ik_proto import Array, ClearanceReply, Collision, FkReply, Mode, SolveReply
from ik_proto.wrist_motion import WristMotion


@dataclass(frozen=True, slots=True, eq=False)
class Hands:
    """What a tracker sees of its operator in a tick.

    Attributes:
        left: The left hand; None where the tracker says nothing of it.
        right: The right hand.
        left_elbow: Direction from the left shoulder to the left elbow and the confidence in it, shape (4,), as in
            `IKClient.solve`; None where the tracker does not see it.
        right_elbow: The same of the right arm.
        weights: Factors on how much each target counts, shape (2, 2), as in `IKClient.solve`; None for ones.
    """

    left: HandSample | None
    right: HandSample | None
    left_elbow: Array | None = None
    right_elbow: Array | None = None
    weights: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class RobotState:
    """What the robot measures, and what its own end makes of the commands it gets.

    Attributes:
        q: Joint positions, shape (n,) [rad].
        dq: Joint velocities, shape (n,) [rad/s].
        time: When they were measured [s].
        waist: Positions of the waist joints, shape (w,) [rad], in the order of `InfoReply.waist_joints`; None where the
            waist stays straight.
        q_set: Where the robot's end holds its joints, shape (n,) [rad]; None where it does not say. It differs from the
            command while that end does not follow.
        tau_set: The feed-forward torque it holds them with, shape (n,) [N m]; None where it does not say.
        ready: Whether the robot's end would follow.
        following: Whether it does.
        note: Why it is not ready, or does not follow; one line, empty where all is well.
    """

    q: Array
    dq: Array
    time: float
    waist: Array | None = None
    q_set: Array | None = None
    tau_set: Array | None = None
    ready: bool = True
    following: bool = True
    note: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """What the robot shall do. Its arrays are read-only.

    Attributes:
        q: Joint positions, shape (n,) [rad].
        tau: Feed-forward torque, shape (n,) [N m].
        time: When it was decided [s], by the clock of who decided it.
        session: Random name of the run of the loop that sends it.
        seq: Number of the command in its session, rising.
        boot_id: The run of the IK service that the motion comes from; empty where none was asked yet.
        engaged: Whether an operator has engaged an arm. The robot's end follows `q` only after it has seen this rise.
        release: Whether the loop is done with the robot, which shall take its arms back.
        motion: How the wrists were asked to move, where the loop drives them by velocity. The robot may show it to
            people; nothing moves by it.
    """

    q: Array
    tau: Array
    time: float
    session: str = ""
    seq: int = 0
    boot_id: str = ""
    engaged: bool = False
    release: bool = False
    motion: WristMotion | None = None


class RobotPort(Protocol):
    """A robot, real or simulated."""

    def read(self) -> RobotState:
        """Read the latest measurement, without waiting for a new one."""
        ...

    def send(self, command: Command) -> None:
        """Hand over a command, without waiting for its execution."""
        ...


class HandSource(Protocol):
    """A tracker: a headset, a camera, a script, a recording."""

    def hands(self, now: float) -> Hands | None:
        """Say what the operator's hands do.

        Args:
            now: Time of the tick [s].

        Returns:
            The latest look at them, or None where there is none.
        """
        ...


class Solver(Protocol):
    """What the load generator needs of an `IKClient`."""

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
        starts: int | None = None,
    ) -> SolveReply:
        """Find joint positions for two wrist targets; see `IKClient.solve`."""
        ...


class Kinematics(Solver, Protocol):
    """What the loop needs of an `IKClient`."""

    def fk(self, q: Array, waist: Array | None = None) -> FkReply:
        """Say where the wrists are; see `IKClient.fk`."""
        ...

    def clearance(self, q: Array, waist: Array | None = None) -> ClearanceReply:
        """Say how clear of itself the body is in some postures; see `IKClient.clearance`."""
        ...


class Limiter(Protocol):
    """Bounds how fast commands change. The last link before the robot port."""

    @property
    def resting_point(self) -> Array:
        """Where the joints come to rest if nothing else is wanted, shape (n,) [rad]; NaN before the first command."""
        ...

    def limit(self, q_last: Array, q_wanted: Array, dt: float | None = None) -> Array:
        """Move from the last command towards the wanted joints.

        Args:
            q_last: Last command, shape (n,) [rad], finite.
            q_wanted: Where to go, shape (n,) [rad]; a joint without a finite goal comes to rest.
            dt: Time since the last command [s]; None for an ordinary tick.

        Returns:
            The next command, shape (n,) [rad], finite. A new array.
        """
        ...
