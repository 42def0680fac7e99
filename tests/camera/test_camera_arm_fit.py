"""The fit of an arm in space: exact from exact evidence, and carried by what is right where something is wrong."""

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from camera_client.arm_fit import LENGTH_SIGMA, ArmEvidence, fit_arms
from camera_client.limb_map import RELATIVE_SIGMA
from ik_proto import Array

ARMS = np.array(
    [
        [[0.18, -0.30, 2.90], [0.22, -0.03, 2.85], [0.20, -0.05, 2.60]],
        [[-0.18, -0.30, 2.92], [-0.45, -0.28, 2.88], [-0.47, -0.52, 2.83]],
    ]
)


def evidence(arms: Array = ARMS) -> ArmEvidence:
    limbs = np.diff(arms, axis=1)
    return ArmEvidence(
        rays=arms / arms[..., 2:],
        across=np.tile([0.012, 0.025, 0.015], (2, 1)),
        measured=arms[..., 2].copy(),
        sigma=np.full((2, 3), 0.03),
        trunk=arms[:, 0].copy(),
        trunk_sigma=np.full(2, 0.025),
        lengths=np.linalg.norm(limbs, axis=-1),
        relative=limbs[..., 2],
    )


def test_exact_evidence_gives_the_arm():
    rng = np.random.default_rng(0)
    for _ in range(5):
        assert np.allclose(fit_arms(evidence(), ARMS + 0.03 * rng.standard_normal(ARMS.shape)), ARMS, atol=2e-3)


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_minimum_that_ipopt_finds(seed):
    rng = np.random.default_rng(seed)
    e = evidence()
    noisy = replace(
        e,
        rays=e.rays + np.concatenate([0.004 * rng.standard_normal((2, 3, 2)), np.zeros((2, 3, 1))], axis=-1),
        measured=e.measured + 0.02 * rng.standard_normal((2, 3)),
        trunk=e.trunk + 0.01 * rng.standard_normal((2, 3)),
        relative=e.relative + 0.05 * rng.standard_normal((2, 2)),
    )

    found = fit_arms(noisy, ARMS)
    best, least = minimum(noisy)
    assert float(cost(noisy, ca.DM(found.reshape(6, 3)))) <= least + 0.05
    assert np.abs(found - best).max() < 0.005


def cost(e: ArmEvidence, P: Any) -> Any:
    """What joints cost, from the formula; P of shape (6, 3)."""
    out = 0.0
    for arm in range(2):
        joints = [P[3 * arm + j, :].T for j in range(3)]
        for j, joint in enumerate(joints):
            off = (joint[:2] - joint[2] * ca.DM(e.rays[arm, j, :2])) / e.across[arm, j]
            deep = (joint[2] - e.measured[arm, j]) / e.sigma[arm, j]
            out += soft(ca.sumsqr(off)) + soft(deep * deep)
        out += soft(ca.sumsqr(joints[0] - ca.DM(e.trunk[arm])) / e.trunk_sigma[arm] ** 2)
        for limb in range(2):
            way = joints[limb + 1] - joints[limb]
            out += ((ca.norm_2(way) - e.lengths[arm, limb]) / LENGTH_SIGMA) ** 2
            out += ((way[2] - e.relative[arm, limb]) / RELATIVE_SIGMA) ** 2
    return out


def soft(square: Any) -> Any:
    return 4.0 * ca.log(1.0 + square / 4.0)


def minimum(e: ArmEvidence) -> tuple[Array, float]:
    """The joints that cost least, by Ipopt, and what they cost."""
    P = ca.SX.sym("P", 6, 3)
    quiet = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.tol": 1e-10}
    solver = ca.nlpsol("solver", "ipopt", {"x": ca.vec(P), "f": cost(e, P)}, quiet)
    answer = solver(x0=ca.vec(ca.DM(ARMS.reshape(6, 3))))
    return np.array(ca.reshape(answer["x"], 6, 3)).reshape(2, 3, 3), float(answer["f"])


def test_an_elbow_that_the_model_puts_beside_its_arm_is_drawn_back():
    e = evidence()
    rays = e.rays.copy()
    # 6 cm up, as models have it where a forearm points at the camera.
    rays[0, 1, 1] -= 0.06 / ARMS[0, 1, 2]
    found = fit_arms(replace(e, rays=rays), rays * e.measured[..., None])
    assert np.linalg.norm(found[0, 1] - ARMS[0, 1]) < 0.045
    assert np.linalg.norm(found[0, [0, 2]] - ARMS[0, [0, 2]], axis=-1).max() < 0.025


def test_a_shoulder_behind_its_arm_is_where_the_trunk_has_it():
    e = evidence()
    measured, sigma = e.measured.copy(), e.sigma.copy()
    measured[0, 0] -= 0.15
    sigma[0, 0] *= 5.0
    found = fit_arms(replace(e, measured=measured, sigma=sigma), ARMS)
    assert np.linalg.norm(found[0, 0] - ARMS[0, 0]) < 0.02


def test_what_is_not_known_does_not_count():
    e = evidence()
    measured = e.measured.copy()
    measured[:, 1] = np.nan
    unknown = replace(e, measured=measured, trunk=np.full((2, 3), np.nan), relative=np.full((2, 2), np.nan))
    found = fit_arms(unknown, ARMS + 0.01)
    assert np.isfinite(found).all()
    assert np.linalg.norm(found - ARMS, axis=-1).max() < 0.03


def test_an_arm_of_unknown_depth_stays_where_it_was_expected():
    nothing = {
        name: np.full(shape, np.nan) for name, shape in (("measured", (2, 3)), ("trunk", (2, 3)), ("relative", (2, 2)))
    }
    found = fit_arms(replace(evidence(), **nothing), ARMS)
    assert np.allclose(found, ARMS, atol=1e-6)
    moved = 1.02 * ARMS
    assert np.linalg.norm(fit_arms(replace(evidence(), **nothing), moved) - moved, axis=-1).max() < 0.1
