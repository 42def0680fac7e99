"""From an operator's arms to a robot's: the same directions of both limbs, from the robot's own shoulders.

    p_wrist = shoulder(u) + upper u + fore f

Directions and the share of the reach are the operator's, whatever the proportions of either: a stretched arm is a
stretched arm, and a bent one has the same bend. Scaling wrists about the pelvis instead, as is often done, puts low
ones out of reach and high ones too low.

The centre of a G1's shoulder is 1.4 cm beside the axis of the first joint, so it is elsewhere for a raised arm than for
a hanging one. That must not be left out: a stretched arm has to bend by 20 degrees to come 1.4 cm short.
"""

from dataclasses import dataclass, field

import numpy as np

from camera_client.vectors import cross, dot, length, unit
from ik_proto import Array

_DOWN = np.array([0.0, 0.0, -1.0])
_ALONG = 0.35
"""Sine of the angle to the axis below which the shoulder's centre is drawn to it."""


@dataclass(frozen=True, slots=True, eq=False)
class RobotArms:
    """What scaling needs to know of a robot, with its waist as it stands.

    Attributes:
        shoulders: Where the upper arms turn while they hang, left and right, pelvis frame, shape (2, 3) [m].
        upper: From there to the elbow [m].
        fore: From the elbow to the wrist target [m].
        hint_origins: Where the IK service measures elbow hints from, the first joint of each arm, shape (2, 3) [m].
        axes: Unit axes of these joints, which turn the shoulders' centres with the upper arms, shape (2, 3).
        mount: Where the body is that the arms are mounted on, at a straight waist: its last joint, shape (3,) [m].
        R_waist: How a bent waist has turned that body and the arms, shape (3, 3).
        p_waist: And moved them: what is at x at a straight waist is at R_waist x + p_waist, shape (3,) [m].
    """

    shoulders: Array
    upper: float
    fore: float
    hint_origins: Array
    axes: Array
    mount: Array
    R_waist: Array = field(default_factory=lambda: np.eye(3))
    p_waist: Array = field(default_factory=lambda: np.zeros(3))


G1_ARMS = RobotArms(
    shoulders=np.array([[0.0, 0.14056, 0.28896], [0.0, -0.14056, 0.28896]]),
    upper=0.1845,
    fore=0.2342,
    hint_origins=np.array([[0.0, 0.10022, 0.29178], [0.0, -0.10022, 0.29178]]),
    axes=np.array([[0.0, 0.96126, 0.27565], [0.0, 0.96126, -0.27565]]),
    mount=np.array([-0.0039635, 0.0, 0.044]),
)
"""A Unitree G1: its shoulder roll joints, elbow joints, `L_ee` and `R_ee` at the zero posture."""


def shoulder_positions(u: Array, robot: RobotArms) -> Array:
    """Where the robot's shoulders are when its upper arms point somewhere.

    The first joint turns the upper arm until it is beside the axis as it is when it hangs, and takes the shoulder's
    centre along; the second joint does the rest. For an arm along the axis any turn would do. Near that the centre is
    drawn to the axis: there it is beside the arm, where it matters little, and so nothing jumps.

    Args:
        u: Unit directions of the upper arms, pelvis frame, shape (2, 3).
        robot: Whose shoulders.

    Returns:
        Shape (2, 3) [m], pelvis frame.
    """
    down_the_trunk = robot.R_waist @ _DOWN
    hanging = unit(down_the_trunk - dot(robot.axes, down_the_trunk)[:, None] * robot.axes)
    ahead = cross(hanging, robot.axes)
    beside = np.maximum(length(cross(u, robot.axes)), _ALONG)
    c, s = (dot(u, hanging) / beside)[:, None], (dot(u, ahead) / beside)[:, None]
    offset = robot.shoulders - robot.hint_origins
    along, down, front = (dot(offset, v)[:, None] for v in (robot.axes, hanging, ahead))
    turned = down * (c * hanging + s * ahead) + front * (c * ahead - s * hanging)
    return robot.hint_origins + along * robot.axes + turned


def wrist_positions(limbs: Array, robot: RobotArms) -> Array:
    """Where the robot's wrists go.

    Args:
        limbs: Unit directions of upper arm and forearm of both arms, pelvis frame, shape (2, 2, 3).
        robot: Whose wrists.

    Returns:
        Shape (2, 3) [m], pelvis frame.
    """
    return shoulder_positions(limbs[:, 0], robot) + robot.upper * limbs[:, 0] + robot.fore * limbs[:, 1]


def elbow_hints(limbs: Array, confidence: Array, robot: RobotArms) -> Array:
    """Where the robot's elbows should be, as `IKClient.solve` takes it.

    Args:
        limbs: As in `wrist_positions`.
        confidence: In the elbows, 0 to 1, shape (2,).
        robot: Whose elbows.

    Returns:
        Direction and confidence, shape (2, 4).
    """
    elbows = shoulder_positions(limbs[:, 0], robot) + robot.upper * limbs[:, 0]
    return np.concatenate([unit(elbows - robot.hint_origins), confidence[:, None]], axis=1)
