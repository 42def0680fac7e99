"""The messages, as typed values. From the wire only `requests` and `replies` make them, so a message can be trusted.

Joint vectors are in wire order (`info` lists the names). Poses are `T_pelvis_wrist`: 4x4, row-major, metres, in the
pelvis frame (x forward, y left, z up). Arrays are float64.

Treat messages as read-only. They are not frozen because one is made for every request and reply at both ends, and a
frozen dataclass takes more than twice as long to make.
"""

from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ik_proto.limits import (
    DEFAULT_ACCELERATION,
    DEFAULT_DAMPING,
    DEFAULT_PERIOD,
    DEFAULT_POSTURE_GAIN,
    DEFAULT_SPEED,
    DEFAULT_STARTS,
)
from ik_proto.status import Status

Array = NDArray[np.float64]

Mode = Literal["track", "reach"]
"""How to solve: stay near `q` and never jump to another branch, or search the whole range of the joints."""
MODES: tuple[Mode, ...] = get_args(Mode)

Collision = Literal["off", "report", "avoid"]
"""What to do about self-collision: nothing, measure the clearance, or keep it."""
COLLISIONS: tuple[Collision, ...] = get_args(Collision)

Frame = Literal["pelvis", "hand"]
"""Along whose axes a twist is given: the pelvis frame's, or each hand's own."""
FRAMES: tuple[Frame, ...] = get_args(Frame)

Law = Literal["adaptive", "fixed"]
"""How twists become joint velocities: exactly, damped only near singular postures, or always damped."""
LAWS: tuple[Law, ...] = get_args(Law)

LimitedBy = Literal["", "speed", "acceleration", "joint", "bounds", "singularity", "collision"]
"""What slows an arm: its largest speed or acceleration, the limit of a joint, the box, its posture, the body."""
LIMITS: tuple[LimitedBy, ...] = get_args(LimitedBy)


@dataclass(slots=True, eq=False)
class SolveRequest:
    """Ask for the joints that bring both wrists to their targets.

    Attributes:
        left_wrist: Target of the left wrist, shape (4, 4) [m].
        right_wrist: Target of the right wrist, shape (4, 4) [m].
        q: Joint positions to start from and to stay near, shape (n,) [rad].
        dq: Joint velocities, shape (n,) [rad/s]. Not used by the presets so far; part of the contract since OpenWBT.
        preset: Name of the cost to minimise; None takes the service's default.
        id: Echoed in the reply.
        mode: How to solve.
        waist: Measured waist joints, shape (w,) [rad]; None for a straight waist. They carry the shoulders, while the
            targets stay in the pelvis frame.
        left_elbow: Wished direction from the left shoulder to the left elbow in the pelvis frame, a unit vector, and
            the confidence in it from 0 to 1, shape (4,); None for no wish.
        right_elbow: The same of the right arm.
        weights: Factors from 0 to 1 on the preset's weights of left position, left rotation, right position and right
            rotation, shape (2, 2); None for ones.
        collision: What to do about self-collision; None takes the service's default.
        starts: Most starts an arm is given in mode "reach".
    """

    left_wrist: Array
    right_wrist: Array
    q: Array
    dq: Array
    preset: str | None = None
    id: int = 0
    mode: Mode = "track"
    waist: Array | None = None
    left_elbow: Array | None = None
    right_elbow: Array | None = None
    weights: Array | None = None
    collision: Collision | None = None
    starts: int = DEFAULT_STARTS


@dataclass(slots=True, eq=False)
class SolveBatchRequest:
    """Ask for the solutions of N problems at once: each row as a `SolveRequest` of its own, to the last bit.

    Attributes:
        left_wrist: Targets of the left wrist, shape (N, 4, 4) [m].
        right_wrist: Targets of the right wrist, shape (N, 4, 4) [m].
        q: Joint positions to start from and to stay near, shape (N, n) [rad].
        dq: Joint velocities, shape (N, n) [rad/s]; None for zeros.
        preset: Name of the cost to minimise, for all rows; None takes the service's default.
        id: Echoed in the reply.
        mode: How to solve, for all rows.
        waist: Measured waist joints, shape (N, w) [rad]; None for a straight waist.
        left_elbow: Wished directions of the left elbow and the confidence in each, shape (N, 4); None for no wish.
        right_elbow: The same of the right arm.
        weights: Factors on the preset's weights, shape (N, 2, 2); None for ones.
        collision: What to do about self-collision, for all rows; None takes the service's default.
        starts: Most starts an arm is given in mode "reach", for all rows.
    """

    left_wrist: Array
    right_wrist: Array
    q: Array
    dq: Array | None = None
    preset: str | None = None
    id: int = 0
    mode: Mode = "track"
    waist: Array | None = None
    left_elbow: Array | None = None
    right_elbow: Array | None = None
    weights: Array | None = None
    collision: Collision | None = None
    starts: int = DEFAULT_STARTS


@dataclass(slots=True, eq=False)
class FkRequest:
    """Ask where the wrists are.

    Attributes:
        q: Joint positions, shape (n,) [rad].
        id: Echoed in the reply.
        waist: Measured waist joints, shape (w,) [rad]; None for a straight waist.
    """

    q: Array
    id: int = 0
    waist: Array | None = None


@dataclass(slots=True, eq=False)
class ClearanceRequest:
    """Ask how clear of itself the body is in some postures, such as those on a way that is about to be taken.

    Attributes:
        q: Joint positions, shape (k, n) [rad].
        id: Echoed in the reply.
        waist: Measured waist joints, the same for all, shape (w,) [rad]; None for a straight waist.
    """

    q: Array
    id: int = 0
    waist: Array | None = None


@dataclass(slots=True, eq=False)
class VelocityRequest:
    """Ask for the joint velocities that give both wrists their twists.

    Attributes:
        left_twist: Linear velocity of the left wrist [m/s] and its angular velocity [rad/s], shape (6,); or the linear
            velocity alone, shape (3,), with no rotation wanted.
        right_twist: The same of the right wrist.
        q: Joint positions, shape (n,) [rad].
        dq: Joint velocities as last commanded, shape (n,) [rad/s]; None leaves the acceleration unbounded.
        id: Echoed in the reply.
        frame: Along whose axes the twists are given.
        law: How twists become joint velocities.
        hold_left: Whether the angular velocity of the left hand counts; else its orientation is left free.
        hold_right: The same of the right hand.
        damping: Damping of the fixed law, and the largest of the adaptive one.
        max_speed: Largest speed of a joint [rad/s].
        max_acceleration: Largest change of a joint's speed [rad/s^2].
        period: Time until the next request [s].
        posture: Joint positions to lean towards, shape (n,) [rad]; None for the middle between the limits.
        posture_gain: Share of the way there that is made in a second [1/s].
        left_bounds: Smallest and largest coordinates of the left wrist, shape (2, 3) [m]; None for no bounds.
        right_bounds: The same of the right wrist.
        waist: Measured waist joints, shape (w,) [rad]; None for a straight waist.
        collision: What to do about self-collision; None takes the service's default.
    """

    left_twist: Array
    right_twist: Array
    q: Array
    dq: Array | None = None
    id: int = 0
    frame: Frame = "pelvis"
    law: Law = "adaptive"
    hold_left: bool = True
    hold_right: bool = True
    damping: float = DEFAULT_DAMPING
    max_speed: float = DEFAULT_SPEED
    max_acceleration: float = DEFAULT_ACCELERATION
    period: float = DEFAULT_PERIOD
    posture: Array | None = None
    posture_gain: float = DEFAULT_POSTURE_GAIN
    left_bounds: Array | None = None
    right_bounds: Array | None = None
    waist: Array | None = None
    collision: Collision | None = None


@dataclass(slots=True)
class InfoRequest:
    """Ask who answers: protocol, robot, joint order, limits, presets.

    Attributes:
        id: Echoed in the reply.
    """

    id: int = 0


Request = SolveRequest | SolveBatchRequest | FkRequest | ClearanceRequest | VelocityRequest | InfoRequest


@dataclass(slots=True, eq=False, kw_only=True)
class Reply:
    """What every reply says.

    Attributes:
        success: Whether the answer may be followed.
        error: One line for a person; empty on success.
        status: One word for a machine.
        id: The request's id.
        boot_id: Random name of this run of the service: a changed one means it was restarted.
    """

    success: bool
    error: str
    status: Status
    id: int = 0
    boot_id: str = ""


@dataclass(slots=True, eq=False, kw_only=True)
class SolveReply(Reply):
    """Answer to a solve, and the form in which any request is refused.

    Attributes:
        sol_q: Joint positions, shape (n,) [rad]; the request's own `q` on failure; None where no `q` could be read.
        tau: Torque that holds the arms at `sol_q` against gravity, shape (n,) [N m]; None on failure.
        position_error: Distance of the left and the right wrist from its target at `sol_q`, shape (2,) [m]; None on
            failure.
        rotation_error: Angle between the left and the right wrist and its target at `sol_q`, shape (2,) [rad]; None on
            failure.
        iterations: Newton iterations, both arms and all starts together.
        solve_us: Time spent solving [us].
        server_us: Time from the request's bytes to its solution [us].
        clearance: Smallest distance between the capsules of any pair checked at `sol_q` [m], negative in penetration;
            None on failure, or where it was not measured.
        nearest: Names of the two capsules that distance is between; None as `clearance`.
        start: Which start the solution came from: 0 for the request's `q`, k for the k-th further one; None on failure.
        starts: Starts tried, both arms together; None on failure.
    """

    sol_q: Array | None = None
    tau: Array | None = None
    position_error: Array | None = None
    rotation_error: Array | None = None
    iterations: int = 0
    solve_us: float = 0.0
    server_us: float = 0.0
    clearance: float | None = None
    nearest: tuple[str, str] | None = None
    start: int | None = None
    starts: int | None = None


@dataclass(slots=True, eq=False, kw_only=True)
class BatchReply(Reply):
    """Answer to a batch. Its `success` says that every row may be followed, its `status` is the gravest of its rows.

    A row that did not converge echoes its `q`, and its other numbers are those at that `q`.

    Attributes:
        sol_q: Joint positions, shape (N, n) [rad].
        statuses: What each row came to, N of them.
        tau: Torque that holds the arms at `sol_q` against gravity, shape (N, n) [N m].
        position_error: Distance of the left and the right wrist from its target at `sol_q`, shape (N, 2) [m].
        rotation_error: Angle between the left and the right wrist and its target at `sol_q`, shape (N, 2) [rad].
        clearance: Smallest distance between the capsules of any pair checked at `sol_q`, shape (N,) [m]; None where it
            was not measured.
        start: Which start each solution came from, N of them: 0 for the row's `q`, k for the k-th further one.
        iterations: Newton iterations of all rows together.
        solve_us: Time spent solving [us].
        server_us: Time from the request's bytes to its solution [us].
    """

    sol_q: Array
    statuses: list[Status]
    tau: Array
    position_error: Array
    rotation_error: Array
    clearance: Array | None
    start: list[int]
    iterations: int
    solve_us: float
    server_us: float


@dataclass(slots=True, eq=False, kw_only=True)
class FkReply(Reply):
    """Where the wrists are.

    Attributes:
        left_wrist: Pose of the left wrist, shape (4, 4) [m].
        right_wrist: Pose of the right wrist, shape (4, 4) [m].
    """

    left_wrist: Array
    right_wrist: Array


@dataclass(slots=True, eq=False, kw_only=True)
class ClearanceReply(Reply):
    """How clear of itself the body is.

    Attributes:
        clearance: Smallest distance between two capsules of any pair checked, in each posture, shape (k,) [m], negative
            in penetration; None where the robot has no capsules.
        nearest: Names of the two capsules that are nearest in the posture with the smallest clearance; None without it.
    """

    clearance: Array | None
    nearest: tuple[str, str] | None


@dataclass(slots=True, eq=False, kw_only=True)
class VelocityReply(Reply):
    """Joint velocities, and what they are worth. Pairs are left, right.

    Attributes:
        dq: Joint velocities, shape (n,) [rad/s].
        twists: What they make of the wrists in the request's frame, linear [m/s] and angular [rad/s], shape (2, 6).
        manipulability: sqrt(det(J J^T)) of the whole twist, or of its linear part where that alone counts, shape (2,)
            [m^3].
        damping: Damping that was used, zero where none was needed, shape (2,).
        limited_by: What slowed each arm the most; empty for nothing.
        limiting_joint: The joint at its limit or its largest speed, where that is what slowed the arm; else None.
        clearance: Smallest distance between two capsules of any pair checked at `q` [m]; None where not measured.
        nearest: Names of the two capsules it is between; None as `clearance`.
        solve_us: Time spent solving [us].
        server_us: Time from the request's bytes to its solution [us].
    """

    dq: Array
    twists: Array
    manipulability: Array
    damping: Array
    limited_by: tuple[LimitedBy, LimitedBy]
    limiting_joint: tuple[str | None, str | None]
    clearance: float | None = None
    nearest: tuple[str, str] | None = None
    solve_us: float = 0.0
    server_us: float = 0.0


@dataclass(slots=True, eq=False, kw_only=True)
class InfoReply(Reply):
    """Who answers.

    Attributes:
        protocol: Version of the contract.
        version: Version of the service.
        robot: Name of the robot.
        model_hash: SHA-256 of the robot's description, hexadecimal.
        joint_names: Names in wire order.
        lower: Lower joint limits, shape (n,) [rad].
        upper: Upper joint limits, shape (n,) [rad].
        velocity: Motor velocity limits, shape (n,) [rad/s].
        shoulders: Centre of each shoulder, left and right, shape (2, 3) [m], pelvis frame.
        reach: Largest distance from shoulder to wrist, left and right, shape (2,) [m].
        presets: Names a solve may ask for.
        default_preset: The one used when it asks for none.
        kernel: How the solver runs: "c" (compiled) or "vm".
        waist_joints: Names of the waist joints a request may give, in order; empty where the robot has none.
        margin: Clearance that an answer keeps where collisions are avoided [m].
        capsules: Names of the capsules between which clearance is measured.
        modes: Modes a solve may ask for.
    """

    protocol: int
    version: str
    robot: str
    model_hash: str
    joint_names: list[str]
    lower: Array
    upper: Array
    velocity: Array
    shoulders: Array
    reach: Array
    presets: list[str]
    default_preset: str
    kernel: str
    waist_joints: list[str] = field(default_factory=list)
    margin: float = 0.0
    capsules: list[str] = field(default_factory=list)
    modes: list[str] = field(default_factory=lambda: list(MODES))


Document = dict[str, Any]
"""A message as a plain mapping. Arrays are numpy arrays on the way out, lists or raw bytes on the way in."""
