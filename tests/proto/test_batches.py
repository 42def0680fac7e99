"""Batches: accepted when each row would be, else refused with field and row, and nothing else can happen."""

import json
from typing import Any

import numpy as np
import pytest
import umsgpack
from hypothesis import given
from hypothesis import strategies as st

from ik_proto import (
    JSON,
    MAX_BATCH,
    MAX_FRAME_BYTES,
    MSGPACK,
    BatchReply,
    Codec,
    RequestError,
    SolveBatchRequest,
    SolveRequest,
    Status,
    gravest,
    parse_request,
    reply_document,
    request_document,
)

N_JOINTS, N_WAIST = 14, 3


def random_poses(rng: np.random.Generator, N: int) -> np.ndarray:
    """Poses that are exact to rounding, and some only to single precision."""
    T = np.tile(np.eye(4), (N, 1, 1))
    Q = np.linalg.qr(rng.normal(size=(N, 3, 3)))[0]
    T[:, :3, :3] = Q * np.sign(np.linalg.det(Q))[:, None, None]
    T[:, :3, 3] = rng.uniform(-0.5, 0.5, (N, 3))
    T[N // 2 :, :3, :3] = T[N // 2 :, :3, :3].astype(np.float32)
    return T


def random_batch(seed: int, N: int) -> SolveBatchRequest:
    """A batch with every array there is."""
    rng = np.random.default_rng(seed)
    arrays: dict[str, Any] = {
        "left_wrist": random_poses(rng, N),
        "right_wrist": random_poses(rng, N),
        "q": rng.uniform(-1.0, 1.0, (N, N_JOINTS)),
        "dq": rng.uniform(-1.0, 1.0, (N, N_JOINTS)),
        "waist": rng.uniform(-0.5, 0.5, (N, N_WAIST)),
        "left_elbow": np.column_stack([rng.normal(size=(N, 3)), rng.uniform(size=N)]),
        "right_elbow": np.column_stack([rng.normal(size=(N, 3)), rng.uniform(size=N)]),
        "weights": rng.uniform(size=(N, 2, 2)),
    }
    return SolveBatchRequest(**arrays)


ARRAYS = ("left_wrist", "right_wrist", "q", "dq", "waist", "left_elbow", "right_elbow", "weights")


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
@given(seed=st.integers(0, 2**32), N=st.integers(1, 20))
def test_a_batch_reads_as_its_rows_do_to_the_last_bit(codec: Codec, seed: int, N: int) -> None:
    batch = random_batch(seed, N)
    got = parse_request(codec.decode(codec.encode(request_document(batch))), N_JOINTS, N_WAIST)
    assert isinstance(got, SolveBatchRequest)
    for k in range(N):
        row = SolveRequest(**{name: getattr(batch, name)[k] for name in ARRAYS})
        alone = parse_request(codec.decode(codec.encode(request_document(row))), N_JOINTS, N_WAIST)
        for name in ARRAYS:
            assert getattr(got, name)[k].tobytes() == getattr(alone, name).tobytes(), name


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
def test_the_largest_batch_fits_a_frame_and_one_row_more_is_refused(codec: Codec) -> None:
    body = codec.encode(request_document(random_batch(1, MAX_BATCH)))
    assert len(body) < MAX_FRAME_BYTES
    got = parse_request(codec.decode(body), N_JOINTS)
    assert isinstance(got, SolveBatchRequest)
    assert got.q.shape == (MAX_BATCH, N_JOINTS)
    reply = BatchReply(
        success=True,
        error="",
        status=Status.OK,
        sol_q=got.q,
        statuses=[Status.OK] * MAX_BATCH,
        tau=got.q,
        position_error=np.full((MAX_BATCH, 2), 1.0 / 3.0),
        rotation_error=np.full((MAX_BATCH, 2), 1.0 / 3.0),
        clearance=np.full(MAX_BATCH, 1.0 / 3.0),
        start=[63] * MAX_BATCH,
        iterations=1,
        solve_us=1.0,
        server_us=1.0,
    )
    assert len(codec.encode(reply_document(reply))) < MAX_FRAME_BYTES
    larger = codec.decode(codec.encode(request_document(random_batch(1, MAX_BATCH + 1))))
    with pytest.raises(RequestError, match="q has 1025 rows; 1 to 1024 are accepted"):
        parse_request(larger, N_JOINTS)


def replaced(array: np.ndarray, row: int, value: Any) -> np.ndarray:
    changed = array.copy()
    changed[row] = value
    return changed


GOOD = random_batch(5, 20)
assert GOOD.waist is not None
assert GOOD.left_elbow is not None
assert GOOD.weights is not None
BAD_ROWS = {
    "left_wrist": (replaced(GOOD.left_wrist, 17, 2.0 * np.eye(4)), r"^left_wrist\[17\] is not a pose: its last row"),
    "right_wrist": (
        replaced(GOOD.right_wrist, 0, np.diag([1.0, 1.0, -1.0, 1.0])),
        r"^right_wrist\[0\] is not a pose: .*reflection",
    ),
    "q": (replaced(GOOD.q, 4, np.nan), r"^q\[4\] holds a number that is not finite"),
    "dq": (replaced(GOOD.q, 19, 90.0), r"^dq\[19\] is beyond 100"),
    "waist": (replaced(GOOD.waist, 3, np.inf), r"^waist\[3\] holds a number that is not finite"),
    "left_elbow": (replaced(GOOD.left_elbow, 8, [0.0, 0.0, 1e-7, 1.0]), r"^left_elbow\[8\] points nowhere"),
    "right_elbow": (replaced(GOOD.left_elbow, 9, [0.0, 0.0, 1.0, 2.0]), r"^right_elbow\[9\] has confidence 2"),
    "weights": (replaced(GOOD.weights, 2, -0.1), r"^weights\[2\] must hold factors from 0 to 1"),
}


@pytest.mark.parametrize("name", BAD_ROWS)
@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
def test_one_bad_row_refuses_the_batch_and_is_named(codec: Codec, name: str) -> None:
    bad, words = BAD_ROWS[name]
    document = request_document(GOOD) | {name: bad, "id": 6}
    # Python's json writes NaN, which orjson does not.
    body = codec.encode(document) if codec is MSGPACK else json.dumps(document, default=np.ndarray.tolist).encode()
    with pytest.raises(RequestError, match=words) as refusal:
        parse_request(codec.decode(body), N_JOINTS)
    assert "\n" not in str(refusal.value)
    assert (refusal.value.status, refusal.value.id) == (Status.BAD_REQUEST, 6)
    assert refusal.value.q is None


@pytest.mark.parametrize("name", [name for name in ARRAYS if name != "q"])
@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
def test_arrays_that_disagree_on_n_are_refused_in_one_line(codec: Codec, name: str) -> None:
    document = request_document(GOOD) | {name: getattr(GOOD, name)[:7]}
    with pytest.raises(RequestError, match=rf"^{name} must .*20x") as refusal:
        parse_request(codec.decode(codec.encode(document)), N_JOINTS)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"q": ...}, "q is missing"),
        ({"q": []}, "q has 0 rows; 1 to 1024 are accepted"),
        ({"q": b""}, "q has 0 rows"),
        ({"q": [0.0] * 14}, "q must have rows of 14, even where there is only one"),
        ({"q": 1.0}, "q must have shape 1x14, not of a single number"),
        ({"q": "rows"}, "q must be an array of numbers"),
        ({"q": [[0.0] * 14, [0.0] * 13]}, "q must be an array of numbers with rows of one length"),
        ({"q": [["0"] * 14] * 20}, "q must be an array of numbers"),
        ({"left_wrist": [np.eye(4).tolist()] * 19 + [[[1.0]]]}, "left_wrist must be an array of numbers"),
        ({"waist": [[0.0] * 2] * 20}, "waist must have shape 20x3, not 20x2"),
        ({"mode": "walk"}, "mode 'walk' is not known, there are track, reach"),
        ({"collision": True}, "collision must be a string, there are off, report, avoid"),
        ({"starts": 257}, "starts must be an integer from 1 to 256"),
        ({"modes": "reach"}, "solve_batch has no field 'modes'"),
    ],
)
def test_a_bad_batch_is_refused_in_one_line(changes: dict[str, Any], words: str) -> None:
    document = {name: value for name, value in (request_document(GOOD) | changes).items() if value is not ...}
    with pytest.raises(RequestError, match=words) as refusal:
        parse_request(document, N_JOINTS)
    assert refusal.value.status is Status.BAD_REQUEST
    assert "\n" not in str(refusal.value)


def test_a_batch_needs_poses_and_q_only() -> None:
    document = {"verb": "solve_batch"} | {name: getattr(GOOD, name) for name in ("left_wrist", "right_wrist", "q")}
    document |= dict.fromkeys(("dq", "waist", "left_elbow", "weights", "mode", "collision", "starts", "preset"))
    got = parse_request(document, N_JOINTS)
    assert isinstance(got, SolveBatchRequest)
    assert (got.dq, got.waist, got.left_elbow, got.weights, got.preset) == (None,) * 5
    assert (got.mode, got.collision, got.starts) == ("track", None, 128)


def test_rows_of_a_foreign_library_are_read() -> None:
    document = {name: getattr(GOOD, name).tolist() for name in ARRAYS} | {"verb": "solve_batch"}
    got = parse_request(MSGPACK.decode(umsgpack.packb(document)), N_JOINTS)
    assert isinstance(got, SolveBatchRequest)
    assert np.array_equal(got.q, GOOD.q)


any_value = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.binary(max_size=300),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=12,
)


@given(
    st.dictionaries(st.sampled_from([*ARRAYS, "id", "mode", "collision", "starts", "preset"]), any_value, max_size=4)
)
def test_a_batch_is_accepted_or_refused_and_nothing_else(changes: dict[str, Any]) -> None:
    try:
        got = parse_request(request_document(GOOD) | changes, N_JOINTS)
    except RequestError as refusal:
        assert refusal.status is Status.BAD_REQUEST
        assert len(str(refusal)) < 200
        return
    assert isinstance(got, SolveBatchRequest)
    for name in ARRAYS:
        value = getattr(got, name)
        assert value is None or np.isfinite(value).all()


def test_the_gravest_row_stands_for_the_batch() -> None:
    answers = [Status.OK, Status.UNREACHABLE, Status.BLOCKED, Status.NOT_CONVERGED]
    for k, worst in enumerate(answers):
        assert gravest(answers[k::-1]) is worst
        assert worst.success is all(status.success for status in answers[: k + 1])
