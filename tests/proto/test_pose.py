"""Only rigid transforms pass, and those that pass come out exact."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto.errors import RowError
from ik_proto.pose import as_pose, as_poses


def random_rotation(seed: int) -> np.ndarray:
    Q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def pose_of(R: np.ndarray, t: tuple[float, float, float] = (0.3, 0.2, 0.1)) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T


@given(st.integers(0, 2**32), st.floats(0.0, 1e-4))
def test_a_nearly_orthonormal_matrix_becomes_the_nearest_rotation(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    R = random_rotation(seed) + noise * rng.uniform(-1.0, 1.0, (3, 3))
    U, _, Vt = np.linalg.svd(R)  # the orthogonal Procrustes solution
    assert np.abs(as_pose(pose_of(R))[:3, :3] - U @ Vt).max() < 2e-12


def test_an_exact_pose_passes_untouched() -> None:
    T = pose_of(np.eye(3))
    assert as_pose(T) is T


def test_the_projection_leaves_its_argument_alone() -> None:
    T = pose_of(random_rotation(1).astype(np.float32).astype(float))
    before = T.copy()
    assert as_pose(T) is not T
    assert np.array_equal(T, before)


REFUSED = {
    "rank one of unit rows and columns": (pose_of(np.full((3, 3), 3**-0.5)), "not a rotation"),
    "twice the identity": (pose_of(2 * np.eye(3)), "not a rotation"),
    "zero": (pose_of(np.zeros((3, 3))), "not a rotation"),
    "shear": (pose_of(np.array([[1, 0.01, 0], [0, 1, 0], [0, 0, 1.0]])), "not a rotation"),
    "reflection": (pose_of(np.diag([1.0, 1.0, -1.0])), "reflection"),
    "point reflection": (pose_of(-np.eye(3)), "reflection"),
    "NaN rotation": (pose_of(np.full((3, 3), np.nan)), "not a rotation"),
    "one NaN": (pose_of(np.array([[1, 0, 0], [0, 1, 0], [0, np.nan, 1.0]])), "not a rotation"),
    "infinite rotation": (pose_of(np.full((3, 3), np.inf)), "not a rotation"),
    "NaN position": (pose_of(np.eye(3), (0.0, np.nan, 0.0)), "position"),
    "millimetres for metres": (pose_of(np.eye(3), (300.0, 200.0, 100.0)), "position"),
    "transposed": (pose_of(np.eye(3)).T, "last row"),
    "projective": (np.vstack([np.eye(3, 4), [0, 0, 0, 2.0]]), "last row"),
}


@pytest.mark.parametrize(("T", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_anything_else_is_refused_with_its_reason(T: np.ndarray, reason: str) -> None:
    """Hazard rows: NaN / Inf; non-orthonormal / reflected."""
    with pytest.raises(ValueError, match=f"^is not a pose: .*{reason}"):
        as_pose(T)


@given(st.integers(0, 2**32), st.integers(1, 30))
def test_a_batch_gives_what_its_rows_give_to_the_last_bit(seed: int, N: int) -> None:
    rng = np.random.default_rng(seed)
    T = np.stack([pose_of(random_rotation(seed + k), tuple(rng.uniform(-1.0, 1.0, 3))) for k in range(N)])
    T[:, :3, :3] += rng.choice([0.0, 1e-15, 1e-9, 1e-5], (N, 1, 1)) * rng.uniform(-1.0, 1.0, (N, 3, 3))
    before = T.copy()
    assert as_poses(T).tobytes() == np.stack([as_pose(row) for row in T]).tobytes()
    assert np.array_equal(T, before)


def test_an_exact_batch_passes_untouched() -> None:
    T = np.stack([pose_of(np.eye(3))] * 3)
    assert as_poses(T) is T


@pytest.mark.parametrize(("T", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_a_batch_names_its_first_bad_row_in_the_same_words(T: np.ndarray, reason: str) -> None:
    batch = np.stack([pose_of(np.eye(3)), pose_of(random_rotation(3)), T, pose_of(np.eye(3)), T])
    with pytest.raises(RowError, match=f"^is not a pose: .*{reason}") as refusal:
        as_poses(batch)
    assert refusal.value.row == 2
    with pytest.raises(ValueError) as alone:  # noqa: PT011
        as_pose(T)
    assert str(refusal.value) == str(alone.value)


numbers = st.floats(allow_nan=True, allow_infinity=True) | st.sampled_from([0.0, 1.0, -1.0, 1e-4])


@given(st.lists(numbers, min_size=16, max_size=16))
def test_a_batch_of_one_and_one_agree_about_any_numbers(entries: list[float]) -> None:
    T = np.array(entries).reshape(4, 4)

    def outcome(read: Callable[[], np.ndarray]) -> bytes | str:
        try:
            return read().tobytes()
        except ValueError as error:
            return str(error)

    assert outcome(lambda: as_pose(T)) == outcome(lambda: as_poses(T[None]))
