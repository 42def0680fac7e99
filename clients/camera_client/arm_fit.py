"""Shoulder, elbow and wrist in space, such that they agree with all that is known of an arm.

A landmark is off by centimetres, most where a limb points at the camera; a depth is off by centimetres, and wrong where
something is in front; the trunk says where a shoulder is; and limbs have their lengths, better known than all of it.
What is found is the maximum a posteriori

    min over P   sum_j  c2((P_j - P_jz ray_j)_xy / w_j) + c1((P_jz - measured_j) / s_j)
               + c3((P_0 - trunk) / t) + sum_l  ((|P_l+1 - P_l| - L_l) / s_L)^2 + ((P_l+1 - P_l)_z - dz_l) / s_dz)^2

with the Cauchy loss c(r) = k log(1 + r^2 / k), k = 4, of the length of its argument. It is found from a start on the
viewing rays (`limb_map`, which chooses between a limb forward and a limb backward) by Gauss-Newton steps, both arms at
once.
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
_EYE = np.eye(3)
_J, _NEAR, _FAR = np.arange(3), np.arange(2), np.arange(1, 3)


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
    seen = np.isfinite(e.measured)
    depth, precision = np.where(seen, e.measured, 0.0), np.where(seen, 1.0 / e.sigma**2, 0.0)
    told = np.isfinite(e.relative)
    relative, relative_precision = np.where(told, e.relative, 0.0), np.where(told, 1.0 / RELATIVE_SIGMA**2, 0.0)
    trunk_known = np.isfinite(e.trunk[:, 0])
    trunk = np.where(trunk_known[:, None], e.trunk, 0.0)
    trunk_precision = np.where(trunk_known, 1.0 / e.trunk_sigma**2, 0.0)
    across_precision = 1.0 / e.across**2
    # d(P_xy - P_z ray_xy)/dP, and its square, of every joint.
    lateral = np.zeros((2, 3, 2, 3))
    lateral[..., 0, 0] = lateral[..., 1, 1] = 1.0
    lateral[..., 2] = -e.rays[..., :2]
    lateral_square = lateral.swapaxes(-1, -2) @ lateral
    P = start.copy()
    for _ in range(_ITERATIONS):
        H = np.zeros((2, 3, 3, 3, 3))
        g = np.zeros((2, 3, 3))
        off = P[..., :2] - P[..., 2:] * e.rays[..., :2]
        weight = across_precision / (1.0 + (off * off).sum(axis=-1) * across_precision / _CAUCHY)
        H[:, _J, _J] = weight[..., None, None] * lateral_square
        g += weight[..., None] * (lateral.swapaxes(-1, -2) @ off[..., None])[..., 0]
        deep = P[..., 2] - depth
        weight = precision / (1.0 + deep * deep * precision / _CAUCHY)
        g[..., 2] += weight * deep
        H[:, _J, _J, 2, 2] += weight
        shifted = P[:, 0] - trunk
        weight = trunk_precision / (1.0 + (shifted * shifted).sum(axis=-1) * trunk_precision / _CAUCHY)
        g[:, 0] += weight[:, None] * shifted
        H[:, 0, 0] += weight[:, None, None] * _EYE
        limb = P[:, 1:] - P[:, :-1]
        size = np.maximum(length(limb), 1e-6)
        along = limb / size[..., None]
        pull = (size - e.lengths) / LENGTH_SIGMA**2
        step = pull[..., None] * along
        step[..., 2] += relative_precision * (limb[..., 2] - relative)
        block = (along[..., :, None] * along[..., None, :]) / LENGTH_SIGMA**2
        block[..., 2, 2] += relative_precision
        g[:, :2] -= step
        g[:, 1:] += step
        H[:, _NEAR, _NEAR] += block
        H[:, _FAR, _FAR] += block
        H[:, _NEAR, _FAR] = H[:, _FAR, _NEAR] = -block
        A = H.transpose(0, 1, 3, 2, 4).reshape(2, 9, 9)
        P = P - np.linalg.solve(A, g.reshape(2, 9, 1)).reshape(2, 3, 3)
    return P
