"""Vector algebra against numpy's own, and its special cases."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from skinned_person import rotation_about

from camera_client.vectors import cross, dot, length, rotate, transport, turn_between, unit

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds)
def test_products_are_numpys(seed):
    a, b = np.random.default_rng(seed).standard_normal((2, 4, 2, 3))
    assert np.allclose(cross(a, b), np.cross(a, b))
    assert np.allclose(dot(a, b), np.einsum("...i,...i", a, b))
    assert np.allclose(length(a), np.linalg.norm(a, axis=-1))
    assert np.allclose(cross(a, b[0, 0]), np.cross(a, b[0, 0]))


@given(seed=seeds)
def test_turns_bring_one_vector_to_the_other(seed):
    rng = np.random.default_rng(seed)
    a, b = unit(rng.standard_normal((2, 5, 3)))
    v = rng.standard_normal((5, 3))
    turn = turn_between(a, b)
    assert np.allclose(rotate(a, turn), b)
    assert np.allclose(transport(v, a, b), rotate(v, turn))
    angle = float(length(turn[0]))
    assert np.allclose(rotate(v[0], turn[0]), rotation_about(turn[0] / max(angle, 1e-12), angle) @ v[0])
    assert np.allclose(rotate(v, np.zeros_like(v)), v)


def test_opposite_vectors_have_a_half_turn_between_them():
    a = unit(np.random.default_rng(0).standard_normal((10, 3)))
    turn = turn_between(a, -a)
    assert np.allclose(length(turn), np.pi)
    assert np.allclose(rotate(a, turn), -a)
    assert np.isfinite(transport(a, a, -a)).all()


def test_nothing_has_no_direction():
    assert (unit(np.zeros((2, 3))) == 0.0).all()
