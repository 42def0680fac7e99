"""From an operator's arms to a robot's: the same directions of both limbs, from the robot's own shoulders.

    p_wrist = shoulder + upper u + fore f

Directions and the share of the reach are the operator's, whatever the proportions of either: a stretched arm is a
stretched arm, and a bent one has the same bend. Scaling wrists about the pelvis instead, as is often done, puts low
ones out of reach and high ones too low.
"""

from dataclasses import dataclass

import numpy as np

from camera_client.vectors import unit
from ik_proto import Array


@dataclass(frozen=True, slots=True, eq=False)
class RobotArms:
    """What scaling needs to know of a robot with a straight waist.

    Attributes:
        shoulders: About where the upper arms turn, left and right, pelvis frame, shape (2, 3) [m].
        upper: From there to the elbow [m].
        fore: From the elbow to the wrist target [m].
        hint_origins: Where the IK service measures elbow hints from, the first joint of each arm, shape (2, 3) [m].
        mount: Where the body is that the arms are mounted on, the last joint of the waist, shape (3,) [m].
    """

    shoulders: Array
    upper: float
    fore: float
    hint_origins: Array
    mount: Array


G1_ARMS = RobotArms(
    shoulders=np.array([[0.0, 0.14056, 0.28896], [0.0, -0.14056, 0.28896]]),
    upper=0.1845,
    fore=0.2342,
    hint_origins=np.array([[0.0, 0.10022, 0.29178], [0.0, -0.10022, 0.29178]]),
    mount=np.array([-0.0039635, 0.0, 0.044]),
)
"""A Unitree G1: its shoulder roll joints, elbow joints, `L_ee` and `R_ee` at the zero posture."""


def wrist_positions(limbs: Array, robot: RobotArms) -> Array:
    """Where the robot's wrists go.

    Args:
        limbs: Unit directions of upper arm and forearm of both arms, pelvis frame, shape (2, 2, 3).
        robot: Whose wrists.

    Returns:
        Shape (2, 3) [m], pelvis frame.
    """
    return robot.shoulders + robot.upper * limbs[:, 0] + robot.fore * limbs[:, 1]


def elbow_hints(limbs: Array, confidence: Array, robot: RobotArms) -> Array:
    """Where the robot's elbows should be, as `IKClient.solve` takes it.

    Args:
        limbs: As in `wrist_positions`.
        confidence: In the elbows, 0 to 1, shape (2,).
        robot: Whose elbows.

    Returns:
        Direction and confidence, shape (2, 4).
    """
    elbows = robot.shoulders + robot.upper * limbs[:, 0]
    return np.concatenate([unit(elbows - robot.hint_origins), confidence[:, None]], axis=1)
