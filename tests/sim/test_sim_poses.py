"""Poses between poses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto import Array
from sim_client.poses import difference, interpolate, rotation_about, rotation_vector, smooth_step

COORDINATE = st.floats(-2.0, 2.0)
VECTORS = st.tuples(COORDINATE, COORDINATE, COORDINATE).map(np.array)
# Below pi: at half a turn the axis has two signs.
ROTATIONS = VECTORS.filter(lambda v: 1e-6 < np.linalg.norm(v) < 3.1)
FRACTIONS = st.floats(0.0, 1.0)


def pose(rotation: Array, position: Array) -> Array:
    T = np.eye(4)
    T[:3, :3] = rotation_about(rotation)
    T[:3, 3] = position
    return T


POSES = st.builds(pose, ROTATIONS, VECTORS)


@given(ROTATIONS)
def test_a_rotation_comes_back_as_its_vector(vector: Array) -> None:
    np.testing.assert_allclose(rotation_vector(rotation_about(vector)), vector, atol=1e-7)


def test_a_quarter_turn_about_z() -> None:
    R = rotation_about(np.array([0.0, 0.0, np.pi / 2]))
    np.testing.assert_allclose(R, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


@given(POSES, POSES)
def test_the_ends_are_exact(T_begin: Array, T_end: Array) -> None:
    np.testing.assert_array_equal(interpolate(T_begin, T_end, 0.0), T_begin)
    np.testing.assert_array_equal(interpolate(T_begin, T_end, 1.0), T_end)


@given(POSES, POSES, FRACTIONS)
def test_what_lies_between_is_a_pose(T_begin: Array, T_end: Array, fraction: float) -> None:
    T = interpolate(T_begin, T_end, fraction)
    np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-9)
    assert np.linalg.det(T[:3, :3]) > 0.0
    np.testing.assert_array_equal(T[3], [0.0, 0.0, 0.0, 1.0])


@given(POSES, POSES, FRACTIONS)
def test_distance_and_angle_grow_in_proportion(T_begin: Array, T_end: Array, fraction: float) -> None:
    distance, angle = difference(T_begin, T_end)
    part = difference(T_begin, interpolate(T_begin, T_end, fraction))
    assert part[0] == pytest.approx(fraction * distance, abs=1e-9)
    assert part[1] == pytest.approx(fraction * angle, abs=1e-6)


@given(POSES, POSES)
def test_difference_has_no_direction(T_a: Array, T_b: Array) -> None:
    assert difference(T_a, T_b) == pytest.approx(difference(T_b, T_a), abs=1e-7)


def test_smooth_step_rests_at_both_ends() -> None:
    step = 1e-4
    assert [smooth_step(x) for x in (-1.0, 0.0, 0.5, 1.0, 2.0)] == [0.0, 0.0, 0.5, 1.0, 1.0]
    for end in (0.0, 1.0 - step):
        assert (smooth_step(end + step) - smooth_step(end)) / step < 1e-6
    assert all(smooth_step(x + step) > smooth_step(x) for x in np.linspace(0.01, 0.98, 50))
