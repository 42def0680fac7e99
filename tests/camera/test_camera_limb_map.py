"""Depths that fit the limbs: against Ipopt on the same cost, and that they do what they are for."""

import casadi as ca
import numpy as np
import pytest

from camera_client.limb_map import LENGTH_SIGMA, RELATIVE_SIGMA, DepthEvidence, cost_of, fit_depths

LENGTHS = np.array([[0.29, 0.25], [0.29, 0.25]])


def evidence(rng: np.random.Generator, sigma: float = 0.03, missing: float = 0.2) -> tuple[DepthEvidence, np.ndarray]:
    """Two random arms 2 to 4 m away, measured and expected with errors; and their true depths, shape (2, 3)."""
    directions = rng.standard_normal((2, 2, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    shoulders = np.array([[0.2, -0.3, 0.0], [-0.2, -0.3, 0.0]]) + np.array([0.0, 0.0, rng.uniform(2.0, 4.0)])
    points = np.concatenate([shoulders[:, None], LENGTHS[..., None] * directions], axis=1).cumsum(axis=1)
    z = points[..., 2]
    measured = z + sigma * rng.standard_normal((2, 3))
    measured[rng.random((2, 3)) < missing] = np.nan
    relative = np.diff(z, axis=1) + 0.08 * rng.standard_normal((2, 2))
    return DepthEvidence(
        rays=points / z[..., None],
        measured=measured,
        sigma=np.full((2, 3), sigma),
        prior=z + 0.05 * rng.standard_normal((2, 3)),
        prior_sigma=np.full((2, 3), 0.06),
        lengths=LENGTHS,
        relative=relative,
    ), z


def ipopt_cost(e: DepthEvidence, arm: int, starts: list[np.ndarray]) -> float:
    """The least cost of one arm that Ipopt finds, with the cost written down anew."""
    z = ca.SX.sym("z", 3)

    def soft(r: ca.SX) -> ca.SX:
        return 4.0 * ca.log(1.0 + r * r / 4.0)

    cost = ca.SX(0.0)
    for j in range(3):
        cost += soft((z[j] - e.prior[arm, j]) / e.prior_sigma[arm, j])
        if np.isfinite(e.measured[arm, j]):
            cost += soft((z[j] - e.measured[arm, j]) / e.sigma[arm, j])
    for i in range(2):
        gap = ca.norm_2(z[i + 1] * ca.DM(e.rays[arm, i + 1]) - z[i] * ca.DM(e.rays[arm, i]))
        cost += ((gap - e.lengths[arm, i]) / LENGTH_SIGMA) ** 2
        cost += ((z[i + 1] - z[i] - e.relative[arm, i]) / RELATIVE_SIGMA) ** 2
    options = {"print_time": 0, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-10}
    solver = ca.nlpsol("least", "ipopt", {"x": z, "f": cost}, options)
    return min(float(solver(x0=start)["f"]) for start in starts)


def test_no_depths_are_better_by_ipopt():
    rng = np.random.default_rng(3)
    gaps = []
    for _ in range(6):
        e, truth = evidence(rng)
        z, cost = fit_depths(e)
        assert cost == pytest.approx(cost_of(e, z))
        for arm in range(2):
            starts = [truth[arm], z[arm], e.prior[arm], truth[arm] + (0.0, 0.2, 0.0), truth[arm] - (0.0, 0.2, 0.0)]
            gaps.append(cost[arm] - ipopt_cost(e, arm, starts))
    # In units of squared standard deviations; a few steps do not end at the very bottom.
    assert max(gaps) < 0.05
    assert min(gaps) > -1e-6


def test_cost_rises_in_every_direction():
    rng = np.random.default_rng(5)
    e, _ = evidence(rng)
    z, cost = fit_depths(e)
    for direction in rng.standard_normal((20, 2, 3)):
        assert (cost_of(e, z + 0.01 * direction) > cost).all()


def test_limb_lengths_make_depths_better():
    rng = np.random.default_rng(0)
    errors, raw = [], []
    for _ in range(300):
        e, truth = evidence(rng, sigma=0.05, missing=0.0)
        z, _ = fit_depths(e)
        errors.append(z - truth)
        raw.append(e.measured - truth)
    assert np.std(errors) < 0.75 * np.std(raw)


def test_a_wrong_depth_is_let_go():
    """The elbow's pixel shows the hand before it, 0.3 m nearer."""
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(200):
        e, truth = evidence(rng, missing=0.0)
        e.measured[:, 1] = truth[:, 1] - 0.3
        z, _ = fit_depths(e)
        errors.append(np.abs(z[:, 1] - truth[:, 1]))
    assert np.median(errors) < 0.04


def test_an_elbow_without_depth_is_found_by_its_limbs():
    rng = np.random.default_rng(2)
    errors = []
    for _ in range(200):
        e, truth = evidence(rng, missing=0.0)
        e.measured[:, 1] = np.nan
        z, _ = fit_depths(e)
        errors.append(np.abs(z[:, 1] - truth[:, 1]))
    assert np.median(errors) < 0.04


def test_no_measurement_at_all_gives_what_was_expected():
    e, _ = evidence(np.random.default_rng(4))
    e.measured[:] = np.nan
    e.relative[:] = np.nan
    z, _ = fit_depths(e)
    assert np.isfinite(z).all()
    assert np.abs(z - e.prior).max() < 0.3
