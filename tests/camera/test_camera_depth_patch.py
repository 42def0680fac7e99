"""Depth patches: against a plain loop on random patches, and the cases that a mean gets wrong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera_client.depth_patch import GAP, RADIUS, patch_depths

SIDE = 2 * RADIUS + 1
SIZE = SIDE**2


def plain(patch: np.ndarray, expected: float) -> tuple[float, float]:
    """Median and share of the cluster, the slow way."""
    values = sorted(v / 1000 for v in patch.ravel().tolist() if v >= 300)
    clusters = [[values[0]]] if values else []
    for value in values[1:]:
        if value - clusters[-1][-1] > GAP:
            clusters.append([])
        clusters[-1].append(value)
    clusters = [c for c in clusters if len(c) >= 0.12 * SIZE]
    if not clusters:
        return np.nan, 0.0
    medians = [c[(len(c) - 1) // 2] for c in clusters]
    worse = [-len(c) for c in clusters] if np.isnan(expected) else [abs(m - expected) for m in medians]
    best = int(np.argmin(worse))
    return medians[best], len(clusters[best]) / SIZE


@given(seed=st.integers(0, 2**32 - 1))
def test_patches_are_those_of_a_plain_loop(seed):
    rng = np.random.default_rng(seed)
    depth = rng.choice([0, 200, 2000, 2040, 2500, 3000], size=(40, 40)).astype(np.uint16)
    depth += rng.integers(0, 60, depth.shape).astype(np.uint16) * (depth > 0)
    pixels = rng.uniform(RADIUS, 39 - RADIUS, (6, 2))
    expected = np.where(rng.random(6) < 0.3, np.nan, rng.uniform(1.8, 3.2, 6))
    found = patch_depths(depth, pixels, expected)
    for i, (column, row) in enumerate(np.rint(pixels).astype(int)):
        patch = depth[row - RADIUS : row + RADIUS + 1, column - RADIUS : column + RADIUS + 1]
        median, share = plain(patch, float(expected[i]))
        assert found.depth[i] == pytest.approx(median, nan_ok=True)
        assert found.share[i] == pytest.approx(share)


def test_a_limb_before_a_wall_is_the_limb_and_not_the_mean():
    depth = np.full((20, 20), 4000, np.uint16)
    depth[:, 8:11] = 2500
    found = patch_depths(depth, np.array([[9.0, 10.0]]), np.array([2.4]))
    assert found.depth[0] == pytest.approx(2.5)
    assert found.share[0] == pytest.approx(1 / 3)
    assert patch_depths(depth, np.array([[9.0, 10.0]]), np.array([np.nan])).depth[0] == pytest.approx(4.0)


def test_a_hand_before_its_forearm_is_the_nearest_part():
    """A forearm that points at the camera runs from the hand to the elbow without a gap."""
    rows = 2500 + 40 * np.maximum(np.arange(SIDE) - 2, 0)
    seen = np.repeat(rows, SIDE).reshape(SIDE, SIDE).astype(np.uint16)
    at, expected = np.array([[4.0, 4.0]]), np.array([2.5])
    whole = patch_depths(seen, at, expected)
    assert (whole.depth[0], whole.share[0]) == (pytest.approx(2.58), 1.0)
    hand = patch_depths(seen, at, expected, np.array([0.25]))
    assert (hand.depth[0], hand.share[0]) == (pytest.approx(2.5), 1.0)
    assert hand.sigma[0] < 0.5 * whole.sigma[0]


def test_all_of_a_cluster_is_what_counts_where_nothing_else_is_said():
    depth = np.random.default_rng(0).normal(2500, 20, (100, 100)).astype(np.uint16)
    pixels = np.random.default_rng(1).uniform(10, 90, (20, 2))
    said, unsaid = (patch_depths(depth, pixels, np.full(20, 2.5), nearest) for nearest in (np.ones(20), None))
    assert (said.depth == unsaid.depth).all()
    assert (said.sigma == unsaid.sigma).all()


def test_spread_is_a_standard_deviation():
    depth = np.random.default_rng(0).normal(2500, 20, (400, 400)).astype(np.uint16)
    pixels = np.random.default_rng(1).uniform(10, 390, (200, 2))
    found = patch_depths(depth, pixels, np.full(200, 2.5))
    assert np.median(found.sigma) == pytest.approx(0.020, rel=0.1)
    assert found.sigma.min() >= 0.012


@pytest.mark.parametrize("pixel", [(-3.0, 5.0), (5.0, 25.0), (np.nan, 5.0), (np.inf, 5.0)])
def test_outside_the_picture_there_is_no_depth(pixel):
    found = patch_depths(np.full((20, 20), 2500, np.uint16), np.array([pixel]), np.array([2.5]))
    assert np.isnan(found.depth[0])
    assert found.share[0] == 0.0
    assert found.sigma[0] == np.inf


def test_at_the_border_only_what_is_in_the_picture_counts():
    found = patch_depths(np.full((20, 20), 2500, np.uint16), np.array([[0.0, 0.0]]), np.array([2.5]))
    assert found.depth[0] == pytest.approx(2.5)
    assert found.share[0] == pytest.approx((RADIUS + 1) ** 2 / SIZE)


def test_unknown_depth_is_none():
    assert np.isnan(patch_depths(np.zeros((20, 20), np.uint16), np.array([[9.0, 9.0]]), np.array([2.5])).depth[0])
