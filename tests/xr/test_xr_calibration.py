"""The neck's pivot and the arms' scale."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from xr_samples import pose, vectors

from xr_client.calibration import TYPICAL_NECK, CalibrationError, arm_scale, fit_neck


def heads_about(pivot, offset, rotations) -> np.ndarray:
    return np.array([pose(pivot, rotation) @ pose(-np.asarray(offset)) for rotation in rotations])


@settings(max_examples=30)
@given(vectors(2.0), vectors(0.2), st.integers(0, 2**32 - 1))
def test_a_neck_is_found(pivot, offset, seed):
    rotations = np.random.default_rng(seed).uniform(-0.6, 0.6, (40, 3))
    neck = fit_neck(heads_about(pivot, offset, rotations))
    np.testing.assert_allclose(neck.offset, offset, atol=1e-9)
    assert neck.residual < 1e-9


def test_noise_shows_in_the_residual():
    rng = np.random.default_rng(1)
    heads = heads_about((0, 0, 1.5), (-0.1, 0, -0.14), rng.uniform(-0.6, 0.6, (200, 3)))
    heads[:, :3, 3] += rng.normal(0.0, 0.005, (200, 3))
    neck = fit_neck(heads)
    np.testing.assert_allclose(neck.offset, [-0.1, 0, -0.14], atol=0.005)
    assert neck.residual == pytest.approx(0.005 * np.sqrt(3), rel=0.2)


def test_what_turns_do_not_show_stays_typical():
    """Turning from side to side says nothing of the neck's height."""
    yaws = np.linspace(-0.8, 0.8, 50)[:, None] * [0.0, 0.0, 1.0]
    neck = fit_neck(heads_about((0, 0, 1.5), (-0.1, 0.01, -0.3), yaws))
    np.testing.assert_allclose(neck.offset, [-0.1, 0.01, TYPICAL_NECK[2]], atol=1e-9)
    assert neck.residual < 1e-9


@pytest.mark.parametrize("turn", [0.0, 0.1])
def test_a_still_head_is_no_fit(turn):
    rotations = np.linspace(-turn, turn, 20)[:, None] * [0.0, 1.0, 0.0]
    with pytest.raises(CalibrationError, match="look left and right"):
        fit_neck(heads_about((0, 0, 1.5), (-0.1, 0, -0.1), rotations))


@pytest.mark.parametrize("name", ["dev-recording", "tracked-recording", "grabLeft"])
def test_recorded_heads_turn_about_a_neck(shared_data, name):
    """Over a second in which the head turns, the fitted point moves less than the eyes do."""
    from xr_client.frames import to_robot

    with np.load(shared_data / "human" / "vr" / f"{name}.npz") as data:
        heads = np.array([to_robot(T) for T in data["head"]])
    better = 0
    windows = [heads[k : k + 90] for k in range(0, len(heads) - 90, 90)]
    fitted = 0
    for window in windows:
        try:
            neck = fit_neck(window)
        except CalibrationError:
            continue
        fitted += 1
        spread = np.sqrt((window[:, :3, 3].var(axis=0)).sum())
        better += neck.residual < spread
    assert fitted >= 1
    assert better == fitted


def test_a_stretched_arm_is_a_stretched_arm():
    assert 0.6 * arm_scale(0.6) == pytest.approx(0.444)
    assert 0.5 * arm_scale(0.5, robot_reach=0.7) == pytest.approx(0.7)


@pytest.mark.parametrize("length", [0.0, -0.5, 60.0, float("nan")])
def test_what_is_no_arm_is_refused(length):
    with pytest.raises(CalibrationError, match="in metres"):
        arm_scale(length)
