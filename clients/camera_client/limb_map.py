"""Depths of shoulder, elbow and wrist on their viewing rays, such that the limbs have the operator's lengths.

The pixel of a joint is known to a few millimetres, its depth to a few centimetres, and not at all where something is in
front of it. Limb lengths tie the three depths of an arm together. What is found is the maximum a posteriori

    min over z   sum_j  c((z_j - measured_j) / s_j) + c((z_j - prior_j) / p_j)
               + sum_l  ((|P_l+1 - P_l| - L_l) / s_L)^2 + ((z_l+1 - z_l - dz_l) / s_dz)^2,      P_j = z_j ray_j

with the Cauchy loss c(r) = k log(1 + r^2 / k), k = 4, which lets a wrong depth go. A limb length has two answers, one
towards the camera and one away from it, so several starts are followed at once by a damped Gauss-Newton method; its
3 x 3 systems are tridiagonal. Both arms and all starts are one array of shape (joint, arm, start).
"""

import math
from dataclasses import dataclass

import numpy as np

from camera_client.vectors import length
from ik_proto import Array

LENGTH_SIGMA = 0.05
"""How well a limb between two pixels has its length: a model's pixels are off by more than a tape measure is [m]."""
RELATIVE_SIGMA = 0.15
"""How well a pose model knows how much deeper one joint is than another [m]."""

_CAUCHY = 4.0
_SQRT_K = math.sqrt(_CAUCHY)
_ITERATIONS = 4
_NEAREST = 0.2
"""No joint is nearer to the camera [m]."""
_TINY = 1e-9
"""Squared length of a limb below which it has no direction."""
_ARMS = np.arange(2)
_FORWARD = np.array([[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, -1.0, 1.0]])
"""Ways of upper arm and forearm, towards the camera or away from it, of four starts."""


@dataclass(frozen=True, slots=True, eq=False)
class DepthEvidence:
    """What is known of the depths of both arms' joints before the limb lengths are.

    Attributes:
        rays: Viewing rays with z = 1, shape (2, 3, 3).
        measured: Depths of the joints' centres, shape (2, 3) [m]; NaN where not measured.
        sigma: Their standard deviations, shape (2, 3) [m].
        prior: Where the last frames expect them, shape (2, 3) [m].
        prior_sigma: Their standard deviations, shape (2, 3) [m].
        lengths: Of upper arm and forearm, shape (2, 2) [m].
        relative: How much deeper the elbow is than the shoulder, and the wrist than the elbow, by the pose model, shape
            (2, 2) [m]; NaN where it does not say.
    """

    rays: Array
    measured: Array
    sigma: Array
    prior: Array
    prior_sigma: Array
    lengths: Array
    relative: Array


def fit_depths(evidence: DepthEvidence) -> tuple[Array, Array]:
    """Find the depths.

    Args:
        evidence: What is known.

    Returns:
        Depths, shape (2, 3) [m], and what they cost, shape (2,).
    """
    problem = _Problem(evidence)
    state = problem.evaluate(_starts(evidence))
    damping = np.full(state.shape[1:], 1e-3)
    for _ in range(_ITERATIONS):
        trial = problem.evaluate(np.maximum(state[:3] - _step(state, damping), _NEAREST))
        better = trial[_COST] < state[_COST]
        np.copyto(state, trial, where=better)
        damping *= np.where(better, 0.1, 30.0)
    best = state[_COST].argmin(axis=1)
    return state[:3, _ARMS, best].T, _CAUCHY * state[_COST, _ARMS, best]


def cost_of(evidence: DepthEvidence, depths: Array) -> Array:
    """What depths cost, shape (2,), for depths of shape (2, 3) [m]."""
    return _CAUCHY * _Problem(evidence).evaluate(depths.T[:, :, None])[_COST, :, 0]


_COST = 3
"""Rows of a state: depths 0 to 2, the cost, half its gradient 4 to 6, half the diagonal of its Hessian 7 to 9, and what
is beside the diagonal, 10 and 11. The cost is in units of k."""


class _Problem:
    """The cost, shaped (joint or limb, arm, start). All that is squared is in units of its deviation times sqrt(k)."""

    def __init__(self, e: DepthEvidence) -> None:
        rays = e.rays.transpose(1, 0, 2) / (LENGTH_SIGMA * _SQRT_K)
        gram = np.vecdot(rays, rays)[..., None]
        self._aa, self._bb = gram[:2], gram[1:]
        self._ab = np.vecdot(rays[:2], rays[1:])[..., None]
        self._lengths = e.lengths.T[..., None] / (LENGTH_SIGMA * _SQRT_K)
        seen, told = np.isfinite(e.measured), np.isfinite(e.relative)
        precision = np.array((np.where(seen, 1.0 / e.sigma, 0.0).T, 1.0 / e.prior_sigma.T))[..., None]
        self._precision = precision / _SQRT_K
        self._targets = self._precision * np.array((np.where(seen, e.measured, 0.0).T, e.prior.T))[..., None]
        self._p = np.where(told, 1.0 / (RELATIVE_SIGMA * _SQRT_K), 0.0).T[..., None]
        self._relative = self._p * np.where(told, e.relative, 0.0).T[..., None]
        self._pp = self._p * self._p

    def evaluate(self, z: Array) -> Array:
        """A state, shape (12, arm, start), of depths, shape (3, arm, start)."""
        out = np.empty((12, *z.shape[1:]))
        out[:3] = z
        near, far = z[:2], z[1:]
        n_near, n_far = near * self._aa - far * self._ab, far * self._bb - near * self._ab
        size = np.sqrt(np.maximum(near * n_near + far * n_far, _TINY))
        j_near, j_far = n_near / size, n_far / size
        r = size - self._lengths
        d = (far - near) * self._p - self._relative
        # Iteratively reweighted least squares: the weight of a Cauchy loss is 1 / (1 + r^2 / k).
        e = z * self._precision - self._targets
        softened = 1.0 + e * e
        weighted = self._precision / softened
        out[_COST] = np.log(softened).sum(axis=(0, 1)) + (r * r + d * d).sum(axis=0)
        gradient, diagonal = out[4:7], out[7:10]
        (weighted * e).sum(axis=0, out=gradient)
        (weighted * self._precision).sum(axis=0, out=diagonal)
        pd = self._p * d
        gradient[:2] += j_near * r - pd
        gradient[1:] += j_far * r + pd
        diagonal[:2] += j_near * j_near + self._pp
        diagonal[1:] += j_far * j_far + self._pp
        out[10:] = j_near * j_far - self._pp
        return out


def _step(state: Array, damping: Array) -> Array:
    """The Gauss-Newton step of every state, by elimination in a tridiagonal matrix, shape (3, arm, start)."""
    g0, g1, g2 = state[4:7]
    h0, h1, h2 = state[7:10] * (1.0 + damping)
    a, b = state[10], state[11]
    m0, m2 = a / h0, b / h2
    x1 = (g1 - m0 * g0 - m2 * g2) / (h1 - m0 * a - m2 * b)
    step = np.empty((3, *g0.shape))
    step[0], step[1], step[2] = (g0 - a * x1) / h0, x1, (g2 - b * x1) / h2
    return step


def _starts(e: DepthEvidence) -> Array:
    """Depths to start from, shape (3, arm, start): as measured, as expected, and each limb forward and backward."""
    starts = np.empty((3, len(_ARMS), 6))
    starts[:, :, 0] = np.where(np.isfinite(e.measured), e.measured, e.prior).T
    starts[:, :, 1] = e.prior.T
    starts[0, :, 2:] = starts[0, :, :1]
    across = length(e.rays[:, 1:, :2] - e.rays[:, :-1, :2])[..., None]
    squares = (e.lengths * e.lengths)[..., None]
    for limb, signs in enumerate(_FORWARD):
        z = starts[limb, :, 2:]
        lateral = across[:, limb] * z
        starts[limb + 1, :, 2:] = z + signs * np.sqrt(np.maximum(squares[:, limb] - lateral * lateral, 0.0))
    return np.maximum(starts, _NEAREST)
