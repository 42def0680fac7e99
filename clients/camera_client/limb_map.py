"""Depths of shoulder, elbow and wrist on their viewing rays, such that the limbs have the operator's lengths.

The pixel of a joint is known to a few millimetres, its depth to a few centimetres, and not at all where something is in
front of it. Limb lengths tie the three depths of an arm together. What is found is the maximum a posteriori

    min over z   sum_j  c((z_j - measured_j) / s_j) + c((z_j - prior_j) / p_j)
               + sum_l  ((|P_l+1 - P_l| - L_l) / s_L)^2 + ((z_l+1 - z_l - dz_l) / s_dz)^2,      P_j = z_j ray_j

with the Cauchy loss c(r) = k log(1 + r^2 / k), k = 4, which lets a wrong depth go. A limb length has two answers, one
towards the camera and one away from it, so several starts are followed at once by a damped Gauss-Newton method; its
3 x 3 systems are tridiagonal. Both arms and all starts are one array of shape (joint, arm, start).
"""

from dataclasses import dataclass

import numpy as np

from ik_proto import Array

LENGTH_SIGMA = 0.05
"""How well a limb between two pixels has its length: a model's pixels are off by more than a tape measure is [m]."""
RELATIVE_SIGMA = 0.15
"""How well a pose model knows how much deeper one joint is than another [m]."""

_CAUCHY = 4.0
_ITERATIONS = 4
_NEAREST = 0.2
"""No joint is nearer to the camera [m]."""


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
        state = np.where(better, trial, state)
        damping = np.where(better, damping * 0.1, damping * 30.0)
    best = state[_COST].argmin(axis=1)
    arms = np.arange(len(best))
    return state[:3, arms, best].T, state[_COST, arms, best]


def cost_of(evidence: DepthEvidence, depths: Array) -> Array:
    """What depths cost, shape (2,), for depths of shape (2, 3) [m]."""
    return _Problem(evidence).evaluate(depths.T[:, :, None])[_COST, :, 0]


_COST = 3
"""Rows of a state: depths 0 to 2, the cost, half its gradient 4 to 6, half the diagonal of its Hessian 7 to 9, and what
is beside the diagonal, 10 and 11."""


class _Problem:
    """The cost, shaped (joint or limb, arm, start)."""

    def __init__(self, e: DepthEvidence) -> None:
        rays = e.rays.transpose(1, 0, 2)
        gram = (rays * rays).sum(axis=-1)[..., None]
        self._aa, self._bb = gram[:2], gram[1:]
        self._ab = (rays[:2] * rays[1:]).sum(axis=-1)[..., None]
        self._lengths = e.lengths.T[..., None]
        seen = np.isfinite(e.measured)
        self._targets = np.stack([np.where(seen, e.measured, 0.0).T, e.prior.T])[..., None]
        self._precision = np.stack([np.where(seen, 1.0 / e.sigma, 0.0).T, 1.0 / e.prior_sigma.T])[..., None]
        told = np.isfinite(e.relative)
        self._relative = np.where(told, e.relative, 0.0).T[..., None]
        self._relative_precision = np.where(told, 1.0 / RELATIVE_SIGMA, 0.0).T[..., None]

    def evaluate(self, z: Array) -> Array:
        """A state, shape (12, arm, start), of depths, shape (3, arm, start)."""
        out = np.empty((12, *z.shape[1:]))
        out[:3] = z
        near, far = z[:2], z[1:]
        n_near, n_far = near * self._aa - far * self._ab, far * self._bb - near * self._ab
        length = np.sqrt(np.maximum(near * n_near + far * n_far, 1e-12))
        scale = 1.0 / (LENGTH_SIGMA * length)
        j_near, j_far = n_near * scale, n_far * scale
        r = (length - self._lengths) / LENGTH_SIGMA
        p = self._relative_precision
        d = (far - near - self._relative) * p
        # Iteratively reweighted least squares: the weight of a Cauchy loss is 1 / (1 + r^2 / k).
        e = (z - self._targets) * self._precision
        softened = 1.0 + e * e / _CAUCHY
        weighted = self._precision / softened
        out[_COST] = _CAUCHY * np.log(softened).sum(axis=(0, 1)) + (r * r + d * d).sum(axis=0)
        gradient, diagonal = out[4:7], out[7:10]
        (weighted * e).sum(axis=0, out=gradient)
        (weighted * self._precision).sum(axis=0, out=diagonal)
        pd, pp = p * d, p * p
        gradient[:2] += j_near * r - pd
        gradient[1:] += j_far * r + pd
        diagonal[:2] += j_near * j_near + pp
        diagonal[1:] += j_far * j_far + pp
        out[10:] = j_near * j_far - pp
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
    base = np.where(np.isfinite(e.measured), e.measured, e.prior).T
    starts = np.empty((3, base.shape[1], 6))
    starts[:, :, 0], starts[:, :, 1] = base, e.prior.T
    starts[0, :, 2:] = base[0, :, None]
    across = e.rays[:, 1:, :2] - e.rays[:, :-1, :2]
    across = np.sqrt((across * across).sum(axis=-1))
    for limb, signs in ((0, (-1.0, -1.0, 1.0, 1.0)), (1, (-1.0, 1.0, -1.0, 1.0))):
        z = starts[limb, :, 2:]
        lateral = across[:, limb, None] * z
        depth = np.sqrt(np.maximum(e.lengths[:, limb, None] ** 2 - lateral * lateral, 0.0))
        starts[limb + 1, :, 2:] = z + np.array(signs) * depth
    return np.maximum(starts, _NEAREST)
