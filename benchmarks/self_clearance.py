"""How near the robot comes to itself, by the capsules that the service itself uses."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from ik_service.clearance import capsule_ends, pair_distances
from ik_service.kinematics import wrist_pose
from ik_service.robot import Robot


def self_clearance(robot: Robot) -> Callable[[np.ndarray], np.ndarray] | None:
    """Make the function that measures it.

    Args:
        robot: The robot.

    Returns:
        From joint positions [rad], shape (N, nq), to the smallest distance of any checked pair [m], shape (N,), at a
        straight waist; None for a robot without capsules.
    """
    model = robot.collision
    if not model.pairs:
        return None
    q = ca.SX.sym("q", robot.nq)
    left, right = robot.arms
    split = len(left.joint_names)
    base = ca.SX(ca.DM(model.base_ends(np.eye(4)).reshape(-1, 3).T))
    ends = capsule_ends(model, wrist_pose(left, q[:split]), wrist_pose(right, q[split:]), base)
    smallest = ca.Function("self_clearance", [q], [ca.mmin(pair_distances(model, ends))])
    return lambda path: np.array(smallest(path.T)).ravel()
