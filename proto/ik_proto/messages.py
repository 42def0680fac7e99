"""The messages, as typed values. From the wire only `requests` and `replies` make them, so a message can be trusted.

Joint vectors are in wire order (`info` lists the names). Poses are `T_pelvis_wrist`: 4x4, row-major, metres, in the
pelvis frame (x forward, y left, z up). Arrays are float64.

Treat messages as read-only. They are not frozen because one is made for every request and reply at both ends, and a
frozen dataclass takes more than twice as long to make.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ik_proto.status import Status

Array = NDArray[np.float64]


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
    """

    left_wrist: Array
    right_wrist: Array
    q: Array
    dq: Array
    preset: str | None = None
    id: int = 0


@dataclass(slots=True, eq=False)
class FkRequest:
    """Ask where the wrists are.

    Attributes:
        q: Joint positions, shape (n,) [rad].
        id: Echoed in the reply.
    """

    q: Array
    id: int = 0


@dataclass(slots=True)
class InfoRequest:
    """Ask who answers: protocol, robot, joint order, limits, presets.

    Attributes:
        id: Echoed in the reply.
    """

    id: int = 0


Request = SolveRequest | FkRequest | InfoRequest


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
    """

    sol_q: Array | None = None
    tau: Array | None = None
    position_error: Array | None = None
    rotation_error: Array | None = None
    iterations: int = 0
    solve_us: float = 0.0
    server_us: float = 0.0


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


Document = dict[str, Any]
"""A message as a plain mapping. Arrays are numpy arrays on the way out, lists or raw bytes on the way in."""
