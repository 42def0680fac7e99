"""Elbow directions and weights: only those in their ranges pass, and directions come out as unit vectors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto.errors import RowError
from ik_proto.hints import as_elbow, as_elbows, as_weight_rows, as_weights

lengths = st.floats(-9.0, 9.0).map(lambda exponent: 10.0**exponent)
directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
elbows = st.builds(
    lambda xyz, length, confidence: np.array([*(np.array(xyz) * length), confidence]),
    directions,
    lengths,
    st.sampled_from([0.0, 0.5, 1.0]) | st.floats(-0.5, 1.5),
)


@given(directions.filter(lambda xyz: np.linalg.norm(xyz) > 1e-3), lengths, st.floats(0.0, 1.0))
def test_only_the_direction_counts(xyz: tuple[float, ...], length: float, confidence: float) -> None:
    direction = np.array(xyz) / np.linalg.norm(xyz)
    if length <= 1e-6:
        length = 1.0
    got = as_elbow(np.array([*(1.01 * length * direction), confidence]))
    assert np.abs(got[:3] - direction).max() < 1e-14
    assert got[3] == confidence


@given(st.lists(elbows, min_size=1, max_size=8))
def test_a_batch_gives_what_its_rows_give_or_names_the_first_bad_one(rows: list[np.ndarray]) -> None:
    alone: list[np.ndarray] = []
    reason = ""
    for row in rows:
        try:
            alone.append(as_elbow(row))
        except ValueError as error:
            reason = str(error)
            break
    if not reason:
        assert as_elbows(np.stack(rows)).tobytes() == np.stack(alone).tobytes()
        return
    with pytest.raises(RowError) as refusal:
        as_elbows(np.stack(rows))
    assert (refusal.value.row, str(refusal.value)) == (len(alone), reason)


def test_an_elbow_nobody_saw_needs_no_direction() -> None:
    assert as_elbow(np.array([1e-7, 0.0, 0.0, 0.0])).tolist() == [0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("elbow", "words"),
    [
        ([0.0, 0.0, 0.0, 1.0], "points nowhere"),
        ([9e-7, 0.0, 0.0, 0.01], "points nowhere: its direction is no longer than 1e-06"),
        ([1.0, 0.0, 0.0, 1.01], "has confidence 1.01, not one from 0 to 1"),
        ([1.0, 0.0, 0.0, -0.5], "has confidence -0.5"),
        ([1.0, 0.0, 0.0, np.nan], "has confidence nan"),
    ],
)
def test_a_wish_that_makes_no_sense_is_refused(elbow: list[float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        as_elbow(np.array(elbow))


@given(st.lists(st.lists(st.floats(-0.2, 1.2), min_size=4, max_size=4), min_size=1, max_size=6))
def test_weights_are_factors_from_0_to_1(entries: list[list[float]]) -> None:
    weights = np.array(entries).reshape(-1, 2, 2)
    bad = [k for k, row in enumerate(weights) if row.min() < 0.0 or row.max() > 1.0]
    if not bad:
        assert as_weight_rows(weights) is weights
        assert all(as_weights(row) is row for row in weights)
        return
    with pytest.raises(RowError, match="must hold factors from 0 to 1") as refusal:
        as_weight_rows(weights)
    assert refusal.value.row == bad[0]
    with pytest.raises(ValueError, match="must hold factors from 0 to 1"):
        as_weights(weights[bad[0]])
