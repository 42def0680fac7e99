"""The filter of the joints: against the textbook's matrices, its lag, its gate, and how it comes to rest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camera_client.kalman import PATIENCE, JointFilter

ONE = np.array([True])
SIGMA = np.full((1, 3), 0.03)


def textbook(z: np.ndarray, dts: np.ndarray, sigma: np.ndarray, acceleration: float) -> np.ndarray:
    """Positions of one joint by the matrices of a 6-state filter that started with the first measurement."""
    x = np.concatenate([z[0], np.zeros(3)])
    P = np.diag([*(sigma**2), 1.0, 1.0, 1.0])
    out = [x[:3].copy()]
    H = np.eye(3, 6)
    for measured, dt in zip(z[1:], dts, strict=True):
        F = np.eye(6)
        F[:3, 3:] = dt * np.eye(3)
        G = np.vstack([0.5 * dt * dt * np.eye(3), dt * np.eye(3)])
        x, P = F @ x, F @ P @ F.T + acceleration**2 * G @ G.T
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(sigma**2))
        x, P = x + K @ (measured - H @ x), (np.eye(6) - K @ H) @ P
        out.append(x[:3].copy())
    return np.array(out)


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_positions_are_the_textbooks(seed):
    rng = np.random.default_rng(seed)
    dts = rng.uniform(0.01, 0.1, 30)
    z = np.cumsum(0.005 * rng.standard_normal((31, 3)), axis=0)
    sigma = rng.uniform(0.01, 0.05, 3)
    f = JointFilter(1, calm=1.0)
    f.update(z[:1], sigma[None], ONE)
    got = [f.position[0].copy()]
    for measured, dt in zip(z[1:], dts, strict=True):
        f.predict(dt)
        f.update(measured[None], sigma[None], ONE)
        got.append(f.position[0].copy())
    assert np.allclose(got, textbook(z, dts, sigma, 12.0), atol=1e-12)


def test_a_joint_at_rest_is_quieter_than_the_textbooks_and_leaves_at_once():
    rng = np.random.default_rng(0)
    # From frame to frame a landmark moves by less than it is off.
    z = 0.01 * rng.standard_normal((300, 1, 3))
    z[200:] += 1.5 * np.arange(100)[:, None, None] / 30.0
    calm, textbooks = JointFilter(1), JointFilter(1, calm=1.0)
    shown = np.empty((2, 300, 3))
    for k, measured in enumerate(z):
        for n, f in enumerate((calm, textbooks)):
            f.predict(1.0 / 30.0 if k else 0.0)
            f.update(measured, SIGMA, ONE)
            shown[n, k] = f.position[0]
    assert shown[0, 30:200].std() < 0.7 * shown[1, 30:200].std()
    late = np.abs(shown - shown[:, 199:200] - 1.5 * np.arange(-200, 100)[:, None] / 30.0)[:, 215:].mean(axis=(1, 2))
    assert late[0] < late[1] + 0.01


@pytest.mark.parametrize("fps", [15.0, 30.0])
@pytest.mark.parametrize("frequency", [0.25, 0.5, 1.0])
def test_lag_is_at_most_25_ms_at_the_speed_of_arms(frequency, fps):
    """The thesis's filter lags by 116 to 162 ms here."""
    f, t = JointFilter(1), np.arange(0.0, 8.0, 1.0 / fps)
    truth = 0.3 * np.sin(2.0 * np.pi * frequency * t)
    got = []
    for value in truth:
        f.predict(1.0 / fps if got else 0.0)
        f.update(np.full((1, 3), value), SIGMA, ONE)
        got.append(f.position[0, 0])
    settled = t > 2.0
    # Phase and gain at the frequency, by projection on it.
    wave = np.exp(-2j * np.pi * frequency * t[settled])
    response = np.sum(wave * np.array(got)[settled]) / np.sum(wave * truth[settled])
    assert abs(-np.angle(response) / (2.0 * np.pi * frequency)) < 0.025
    assert abs(response) == pytest.approx(1.0, abs=0.1)


def test_noise_gets_less():
    rng = np.random.default_rng(0)
    f, got = JointFilter(1), []
    for _ in range(2000):
        f.predict(1.0 / 30.0)
        f.update(0.03 * rng.standard_normal((1, 3)), SIGMA, ONE)
        got.append(f.position[0].copy())
    assert np.std(got[100:]) < 0.75 * 0.03


def still(f: JointFilter, frames: int = 30) -> None:
    for _ in range(frames):
        f.predict(1.0 / 30.0)
        f.update(np.zeros((1, 3)), SIGMA, ONE)


def test_an_outlier_is_refused_and_a_new_place_believed():
    f = JointFilter(1)
    still(f)
    anew = []
    for _ in range(PATIENCE + 2):
        f.predict(1.0 / 30.0)
        # Far away, and not still: refusing must not depend on the place being the same.
        anew.append(bool(f.update(np.array([[0.0, 0.0, 3.0]]), SIGMA, ONE)[0]))
        if anew[-1]:
            break
        assert abs(f.position[0, 2]) < 0.05
    assert anew[-1]
    assert f.position[0, 2] == pytest.approx(3.0)
    assert (f.velocity == 0.0).all()


def test_a_joint_that_is_not_seen_slows_down():
    f = JointFilter(1)
    for k in range(30):
        f.predict(1.0 / 30.0)
        f.update(np.full((1, 3), k / 30.0), SIGMA, ONE)
    assert f.velocity[0, 0] == pytest.approx(1.0, abs=0.05)
    before = f.position[0, 0]
    for _ in range(60):
        f.update(np.zeros((1, 3)), SIGMA, ~ONE)
        f.predict(1.0 / 30.0)
    assert f.position[0, 0] - before < 0.15
    assert abs(f.velocity[0, 0]) < 1e-6
    assert f.sigma[0, 0] > 0.1


def test_joints_do_not_disturb_each_other():
    rng = np.random.default_rng(0)
    both, alone = JointFilter(2), JointFilter(1)
    for _ in range(50):
        z = rng.standard_normal((2, 3)) * 0.02
        for f in (both, alone):
            f.predict(0.03)
        both.update(z, np.full((2, 3), 0.03), np.array([True, rng.random() < 0.5]))
        alone.update(z[:1], SIGMA, ONE)
    assert (both.position[0] == alone.position[0]).all()


def test_a_forgotten_joint_starts_anew():
    f = JointFilter(1)
    still(f)
    f.forget(ONE)
    assert not f.known[0]
    assert f.sigma[0, 0] == np.inf
    assert f.update(np.ones((1, 3)), SIGMA, ONE)[0]
    assert (f.position == 1.0).all()
