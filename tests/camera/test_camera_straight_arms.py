"""Nearly straight arms: what is taken out of their bend, and what stays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from painted_person import BENT
from skinned_person import Array, rotation_about

from camera_client.scaling import G1_ARMS
from camera_client.straight_arms import NOISE, straightened

UPPER, FORE = G1_ARMS.upper, G1_ARMS.fore
BENDS = st.floats(0.0, np.pi - 0.01)


def arms(bends: tuple[float, float], seed: int = 0) -> tuple[Array, Array]:
    """Limbs and wrists of arms that are bent so much [rad], pointing anywhere."""
    rng = np.random.default_rng(seed)
    limbs, R = np.empty((2, 2, 3)), np.empty((2, 3, 3))
    for side, bend in enumerate(bends):
        turn = rotation_about(_unit(rng.normal(size=3)), rng.uniform(-np.pi, np.pi))
        u, f = np.array([1.0, 0.0, 0.0]), np.array([np.cos(bend), 0.0, np.sin(bend)])
        limbs[side] = turn @ u, turn @ f
        R[side] = turn @ np.stack([f, [0.0, 1.0, 0.0], np.cross(f, [0.0, 1.0, 0.0])], axis=-1)
    return limbs, R


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _angle(a: Array, b: Array) -> Array:
    return 2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(_unit(a) - _unit(b), axis=-1), 0.0, 1.0))


@given(BENDS, BENDS, st.integers(0, 1000))
def test_the_hand_stays_in_its_direction_and_the_bend_shrinks_by_the_formula(left: float, right: float, seed: int):
    limbs, R = arms((left, right), seed)
    straighter, _ = straightened(limbs, R, UPPER, FORE)
    before, after = (UPPER * each[:, 0] + FORE * each[:, 1] for each in (limbs, straighter))
    assert _angle(before, after).max() < 1e-6
    bends = np.array([left, right])
    expected = bends**3 / (bends**2 + NOISE**2)
    assert np.allclose(_angle(straighter[:, 0], straighter[:, 1]), expected, atol=1e-6)
    assert np.linalg.norm(straighter, axis=-1) == pytest.approx(np.ones((2, 2)))
    # Both limbs stay in the plane of the bend.
    normal = np.cross(limbs[:, 0], limbs[:, 1])
    assert np.abs((straighter * normal[:, None]).sum(axis=-1)).max() < 1e-6


@given(BENDS, BENDS, st.integers(0, 1000))
def test_the_hand_turns_with_its_forearm_and_no_further(left: float, right: float, seed: int):
    limbs, R = arms((left, right), seed)
    straighter, turned = straightened(limbs, R, UPPER, FORE)
    assert np.allclose(turned @ np.swapaxes(turned, 1, 2), np.eye(3), atol=1e-9)
    assert np.allclose(turned[:, :, 0], straighter[:, 1], atol=1e-9)
    moved = np.arccos(np.clip(0.5 * (np.trace(turned @ np.swapaxes(R, 1, 2), axis1=1, axis2=2) - 1.0), -1.0, 1.0))
    assert np.allclose(moved, _angle(straighter[:, 1], limbs[:, 1]), atol=1e-5)


def test_straight_arms_stay_and_well_bent_ones_hardly_change():
    limbs, R = arms((0.0, np.pi / 2.0))
    straighter, turned = straightened(limbs, R, UPPER, FORE)
    assert np.allclose(straighter[0], limbs[0], atol=1e-12)
    assert np.allclose(turned[0], R[0], atol=1e-12)
    assert _angle(straighter[1], limbs[1]).max() < np.radians(1.0)


def test_nothing_is_done_to_its_arguments():
    limbs, R = arms((0.2, 0.3))
    before = limbs.copy(), R.copy()
    straightened(limbs, R, UPPER, FORE)
    assert np.array_equal(limbs, before[0])
    assert np.array_equal(R, before[1])
    assert _angle(straightened(BENT, np.tile(np.eye(3), (2, 1, 1)), UPPER, FORE)[0], BENT).max() > 0.0


@pytest.mark.parametrize(("bend", "gain"), [(0.0, 0.8), (3.0, 0.82), (8.0, 0.87), (60.0, 1.01)])
def test_upper_arms_that_are_seen_with_noise_are_nearer_to_the_truth(bend: float, gain: float):
    """Elbows seen 25 mm beside where they are, in both directions across the arm. Bent arms must not pay for it."""
    rng = np.random.default_rng(1)
    truth, R = arms((np.radians(bend), np.radians(bend)))
    raw, kept = [], []
    for _ in range(400):
        shift = rng.normal(0.0, 0.025, (2, 3))
        joints = np.stack([UPPER * truth[:, 0] + shift, FORE * truth[:, 1] - shift], axis=1)
        seen = _unit(joints)
        raw.append(_angle(seen, truth))
        kept.append(_angle(straightened(seen, R, UPPER, FORE)[0], truth))
    assert np.mean(kept) < gain * np.mean(raw)
