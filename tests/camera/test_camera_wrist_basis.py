"""Wrist orientation: the G1's at its zero posture, a rotation always, and no twist at a straight arm."""

import numpy as np
import pinocchio as pin
import pytest
from arm_metrics import angle_between
from hypothesis import given
from hypothesis import strategies as st
from skinned_person import rotation_about
from thesis_chain import bend_basis

from camera_client.vectors import unit
from camera_client.wrist_basis import RATE, WristBasis, flexion_weight
from ik_proto.robots import load_description

SURE = np.ones(2)
DT = 1.0 / 30.0


def test_it_is_the_g1s_wrist_at_the_zero_posture():
    model = pin.buildModelFromMJCF(str(load_description("g1").model))
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    u, f, R = [], [], []
    for side in ("left", "right"):
        shoulder, elbow, wrist = (
            data.oMi[model.getJointId(f"{side}_{joint}_joint")] for joint in ("shoulder_roll", "elbow", "wrist_yaw")
        )
        u.append(elbow.translation - shoulder.translation)
        f.append(wrist.translation - elbow.translation)
        R.append(wrist.rotation)
    got = WristBasis().update(unit(np.array(u)), unit(np.array(f)), 0.0, SURE)
    # The G1's forearm slopes by 3 degrees and its joints are offset; the axes are the same.
    assert (angle_between(got, np.array(R)) < 6.0).all()


@given(seed=st.integers(0, 2**32 - 1))
def test_it_is_a_rotation_along_the_forearm(seed):
    rng, basis = np.random.default_rng(seed), WristBasis()
    for _ in range(10):
        u, f = unit(rng.standard_normal((2, 2, 3)))
        R = basis.update(u, f, DT, rng.random(2))
        assert np.allclose(R @ R.transpose(0, 2, 1), np.eye(3), atol=1e-9)
        assert np.allclose(np.linalg.det(R), 1.0)
        assert np.allclose(R[:, :, 0], f)


def test_a_bent_arm_has_the_axis_of_its_elbow():
    rng, compared = np.random.default_rng(0), 0
    for _ in range(50):
        u, f = unit(rng.standard_normal((2, 2, 3)))
        bent = flexion_weight(u, f) == 1.0
        basis = WristBasis()
        R = basis.update(u, f, DT, SURE)
        for arm in np.flatnonzero(bent):
            published = bend_basis(np.array([np.zeros(3), u[arm], u[arm] + f[arm]]))
            assert np.allclose(R[arm], published, atol=1e-9)
            compared += 1
    assert compared > 40


def noisy_sweep(rng: np.random.Generator) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """An arm that straightens, is noisy there, and bends again: ours and the published orientations."""
    basis, ours, published = WristBasis(), [], []
    for flexion in np.concatenate([np.linspace(1.2, 0.0, 40), np.zeros(30), np.linspace(0.0, 1.2, 40)]):
        u = np.array([0.0, 0.3, -1.0])
        f = rotation_about(np.array([0.0, -1.0, 0.0]), flexion) @ u
        arm = np.array([np.zeros(3), 0.29 * unit(u), 0.29 * unit(u) + 0.25 * unit(f)])
        arm += 0.015 * rng.standard_normal((3, 3))
        limbs = unit(np.diff(arm, axis=0))
        R = basis.update(np.tile(limbs[0], (2, 1)), np.tile(limbs[1], (2, 1)), DT, SURE)
        ours.append(R[0])
        published.append(bend_basis(arm))
    return ours, published


def test_a_straight_arm_does_not_twist():
    ours, published = noisy_sweep(np.random.default_rng(0))
    assert angle_between(np.array(ours[1:]), np.array(ours[:-1])).max() < 30.0
    # The negative control: the published orientation does.
    assert (angle_between(np.array(published[1:]), np.array(published[:-1])) > 30.0).sum() > 10


def test_an_axis_that_was_held_is_found_again_at_a_bounded_rate():
    u, f = np.tile([0.0, 0.0, -1.0], (2, 1)), np.tile([1.0, 0.0, 0.0], (2, 1))
    basis = WristBasis()
    start = basis.update(u, f, DT, SURE)
    # The elbow's axis turns over at once; the wrist comes after it.
    last, turned = start, []
    for _ in range(60):
        R = basis.update(np.tile([0.0, 0.6, 0.8], (2, 1)), f, DT, SURE)
        turned.append(angle_between(R, last).max())
        last = R
    assert max(turned) <= np.degrees(RATE * DT) + 1e-6
    assert np.allclose(last[0], bend_basis(np.array([[0.0, 0.0, 0.0], [0.0, 0.6, 0.8], [1.0, 0.6, 0.8]])), atol=0.02)


def test_without_confidence_nothing_is_followed():
    u, f = np.tile([0.0, 0.0, -1.0], (2, 1)), np.tile([1.0, 0.0, 0.0], (2, 1))
    basis = WristBasis()
    start = basis.update(u, f, DT, SURE)
    for _ in range(30):
        R = basis.update(np.tile([0.0, 1.0, 0.0], (2, 1)), f, DT, np.zeros(2))
    assert np.allclose(R, start)


@pytest.mark.parametrize(("degrees", "weight"), [(5.0, 0.0), (6.5, 0.0), (30.0, 1.0), (90.0, 1.0), (150.0, 1.0)])
def test_the_bend_counts_as_far_as_there_is_one(degrees, weight):
    f = np.array([[np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0]])
    assert flexion_weight(np.array([[1.0, 0.0, 0.0]]), f)[0] == pytest.approx(weight)
