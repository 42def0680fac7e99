"""Shoulder, elbow and wrist in space, such that they agree with all that is known of an arm.

A landmark is off by centimetres, most where a limb points at the camera; a depth is off by centimetres, and wrong where
something is in front; the trunk says where a shoulder is; and limbs have their lengths, better known than all of it.
What is found is the maximum a posteriori

    min over P   sum_j  c2((P_j - P_jz ray_j)_xy / w_j) + c1((P_jz - measured_j) / s_j)
               + c3((P_0 - trunk) / t) + sum_l  ((|P_l+1 - P_l| - L_l) / s_L)^2 + ((P_l+1 - P_l)_z - dz_l) / s_dz)^2

with the Cauchy loss c(r) = k log(1 + r^2 / k), k = 4, of the length of its argument. It is found from a start on the
viewing rays (`limb_map`, which chooses between a limb forward and a limb backward) by Gauss-Newton steps, both arms at
once. All that is known is a row J P = target with a standard deviation of 1, and only the rows of limb lengths change
from step to step.
"""

from dataclasses import dataclass

import numpy as np

from camera_client.limb_map import RELATIVE_SIGMA
from camera_client.vectors import length
from ik_proto import Array

LENGTH_SIGMA = 0.02
"""How well a limb has its calibrated length [m]."""
_CAUCHY = 4.0
_ITERATIONS = 3

_JOINT, _LIMB = np.arange(3), np.arange(2)
_X, _Y, _DEPTH, _TRUNK, _RELATIVE, _LENGTH = _JOINT, 3 + _JOINT, 6 + _JOINT, 9 + _JOINT, 12 + _LIMB, 14 + _LIMB
"""Rows: each joint across its ray, its depth, the shoulder's place in the trunk; of each limb what the model says, and
the length."""
_LOSS = np.array([0, 1, 2, 0, 1, 2, 3, 4, 5, 6, 6, 6, -1, -1, -1, -1])
"""Rows that share an argument of the Cauchy loss; those with -1 have none."""
_SHARED = ((_LOSS[:, None] == _LOSS) & (_LOSS >= 0)) / _CAUCHY
_RIDGE = 1e-8 * np.eye(9)
"""Keeps a joint where it is of whose depth nothing is known [1/m^2]."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmEvidence:
    """What is known of both arms, optical frame.

    Attributes:
        rays: Viewing rays with z = 1, shape (2, 3, 3).
        across: Standard deviations of the joints across them, shape (2, 3) [m].
        measured: Depths of the joints' centres, shape (2, 3) [m]; NaN where not measured.
        sigma: Their standard deviations, shape (2, 3) [m].
        trunk: Where the trunk has its shoulders, shape (2, 3) [m]; NaN where it does not say.
        trunk_sigma: Its standard deviations, shape (2,) [m].
        lengths: Of upper arm and forearm, shape (2, 2) [m].
        relative: How much deeper the elbow is than the shoulder, and the wrist than the elbow, by the pose model, shape
            (2, 2) [m]; NaN where it does not say.
    """

    rays: Array
    across: Array
    measured: Array
    sigma: Array
    trunk: Array
    trunk_sigma: Array
    lengths: Array
    relative: Array


def fit_arms(e: ArmEvidence, start: Array) -> Array:
    """Find the joints.

    Args:
        e: What is known.
        start: Joints to start from, shape (2, 3, 3) [m].

    Returns:
        Joints, shape (2, 3, 3) [m].
    """
    J, target = _rows(e)
    by_joint = J.reshape(2, 16, 3, 3)
    P = start.reshape(2, 9, 1)
    for _ in range(_ITERATIONS):
        limb = (P[:, 3:] - P[:, :-3]).reshape(2, 2, 3)
        along = limb / (LENGTH_SIGMA * np.maximum(length(limb), 1e-6))[..., None]
        by_joint[:, _LENGTH, _LIMB], by_joint[:, _LENGTH, _LIMB + 1] = -along, along
        r = (J @ P)[..., 0] - target
        weight = 1.0 / (1.0 + (r * r) @ _SHARED)
        weighted = (weight[..., None] * J).swapaxes(1, 2)
        P = P - np.linalg.solve(weighted @ J + _RIDGE, weighted @ r[..., None])
    return P.reshape(2, 3, 3)


def _rows(e: ArmEvidence) -> tuple[Array, Array]:
    """J, shape (2, 16, 9), without the rows of limb lengths, and the target, shape (2, 16)."""
    J, target = np.zeros((2, 16, 3, 3)), np.zeros((2, 16))
    across = 1.0 / e.across
    J[:, _X, _JOINT, 0] = J[:, _Y, _JOINT, 1] = across
    J[:, _X, _JOINT, 2], J[:, _Y, _JOINT, 2] = -across * e.rays[..., 0], -across * e.rays[..., 1]
    # What is not known is a row of zeros.
    seen, told, trunk = np.isfinite(e.measured), np.isfinite(e.relative), np.isfinite(e.trunk[:, :1])
    J[:, _DEPTH, _JOINT, 2] = deep = np.where(seen, 1.0 / e.sigma, 0.0)
    J[:, _TRUNK, 0, _JOINT] = fixed = np.where(trunk, 1.0 / e.trunk_sigma[:, None], 0.0)
    J[:, _RELATIVE, _LIMB + 1, 2] = deeper = np.where(told, 1.0 / RELATIVE_SIGMA, 0.0)
    J[:, _RELATIVE, _LIMB, 2] = -deeper
    target[:, _DEPTH] = np.where(seen, e.measured, 0.0) * deep
    target[:, _TRUNK] = np.where(trunk, e.trunk, 0.0) * fixed
    target[:, _RELATIVE] = np.where(told, e.relative, 0.0) * deeper
    target[:, _LENGTH] = e.lengths / LENGTH_SIGMA
    return J.reshape(2, 16, 9), target
