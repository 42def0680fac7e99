"""Rotations against Pinocchio, which we did not write."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_client.rotation import rotation_matrix, rotation_vector, turn

pinocchio = pytest.importorskip("pinocchio")

AXIS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 1e-3)
ANGLE = st.floats(0.0, np.pi) | st.sampled_from([0.0, 1e-300, 1e-12, 1e-8, 1e-4, np.pi - 1e-4, np.pi - 1e-8])


@given(AXIS, ANGLE)
def test_the_exponential_agrees_with_pinocchio(axis, angle):
    vector = axis / np.linalg.norm(axis) * angle
    np.testing.assert_allclose(rotation_matrix(vector), pinocchio.exp3(vector), rtol=0, atol=1e-14)


@given(AXIS, ANGLE)
def test_the_logarithm_undoes_it_at_every_angle(axis, angle):
    R = rotation_matrix(axis / np.linalg.norm(axis) * angle)
    vector = rotation_vector(R)
    assert np.linalg.norm(vector) <= np.pi + 1e-15
    np.testing.assert_allclose(rotation_matrix(vector), R, rtol=0, atol=1e-14)
    assert turn(np.eye(3), R) == pytest.approx(angle, abs=1e-14)


@given(AXIS, st.floats(0.0, 3.1))
def test_the_logarithm_agrees_with_pinocchio_short_of_a_half_turn(axis, angle):
    R = rotation_matrix(axis / np.linalg.norm(axis) * angle)
    np.testing.assert_allclose(rotation_vector(R), pinocchio.log3(R), rtol=0, atol=1e-7)


def test_a_half_turn_has_a_vector():
    for axis in np.eye(3):
        R = 2.0 * np.outer(axis, axis) - np.eye(3)
        np.testing.assert_allclose(np.abs(rotation_vector(R)), np.pi * axis, rtol=0, atol=1e-15)
