"""Requests: what is accepted, what is refused and in which words, and that nothing else can happen."""

import json
import tracemalloc
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto import (
    JSON,
    MSGPACK,
    Codec,
    DecodeError,
    FkRequest,
    InfoRequest,
    RequestError,
    SolveRequest,
    Status,
    parse_request,
    request_document,
)

N = 14
T = np.array([[0.0, -1.0, 0.0, 0.3], [1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.1], [0.0, 0.0, 0.0, 1.0]])
Q = np.linspace(-1.0, 1.0, N)


def solve_document(**changes: Any) -> dict[str, Any]:
    document = {"verb": "solve", "id": 5, "left_wrist": T.tolist(), "right_wrist": T.tolist(), "q": Q.tolist()}
    document["dq"] = [0.0] * N
    document.update(changes)
    return {name: value for name, value in document.items() if value is not ...}


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
def test_a_solve_survives_the_wire(codec: Codec) -> None:
    sent = SolveRequest(T, T @ T, Q, -Q, preset="openwbt", id=2**53 - 1)
    got = parse_request(codec.decode(codec.encode(request_document(sent))), N)
    assert isinstance(got, SolveRequest)
    for name in ("q", "dq", "left_wrist"):
        assert np.array_equal(getattr(got, name), getattr(sent, name)), name
    assert np.allclose(got.right_wrist, sent.right_wrist, atol=1e-15)
    assert (got.preset, got.id) == (sent.preset, sent.id)


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
def test_fk_and_info_survive_the_wire(codec: Codec) -> None:
    fk = parse_request(codec.decode(codec.encode(request_document(FkRequest(Q, id=3)))), N)
    assert isinstance(fk, FkRequest)
    assert np.array_equal(fk.q, Q)
    assert fk.id == 3
    assert parse_request(codec.decode(codec.encode(request_document(InfoRequest(id=4)))), N) == InfoRequest(id=4)


def test_a_plain_solve_stands_for_the_defaults() -> None:
    got = parse_request(solve_document(), N)
    assert isinstance(got, SolveRequest)
    assert (got.mode, got.collision, got.starts) == ("track", None, 128)
    assert (got.waist, got.left_elbow, got.right_elbow, got.weights, got.preset) == (None,) * 5
    names = ("mode", "waist", "left_elbow", "right_elbow", "weights", "collision", "starts", "preset")
    null = parse_request(solve_document(**dict.fromkeys(names)), N)
    assert [getattr(null, name) for name in names] == [getattr(got, name) for name in names]
    # What is not asked for is not sent either: a plain request is no longer than it ever was.
    assert request_document(got).keys() == {"v", "id", "verb", "left_wrist", "right_wrist", "q", "dq"}


def test_what_openwbt_calls_by_our_names_is_ignored() -> None:
    document = solve_document(waist="left", mode=3, weights=[80.0], current_lr_arm_q=Q.tolist())
    document["current_lr_arm_dq"] = document.pop("dq")
    got = parse_request(document, N)
    assert isinstance(got, SolveRequest)
    assert (got.mode, got.waist, got.weights) == ("track", None, None)


@pytest.mark.parametrize("n_waist", [0, 1, 3])
def test_the_waist_has_as_many_joints_as_the_robot(n_waist: int) -> None:
    waist = [0.1] * n_waist
    for document in (solve_document(waist=waist), {"verb": "fk", "q": Q.tolist(), "waist": waist}):
        got = parse_request(document, N, n_waist)
        assert isinstance(got, SolveRequest | FkRequest)
        assert got.waist is not None
        assert got.waist.tolist() == waist
        with pytest.raises(RequestError, match="waist must have shape"):
            parse_request(document | {"waist": [0.0] * 4}, N, n_waist)


@pytest.mark.parametrize("verb", ["solve", "solve_batch", "fk"])
@pytest.mark.parametrize("field", ["q", "left_wrist", "waist", "weights"])
def test_strings_cost_no_more_memory_than_they_bring(verb: str, field: str) -> None:
    """One long string among many empty ones: as an array of strings of one length it would be a hundred gigabytes."""
    long = "x" * 1_000_000
    many = [[long] + [""] * 99_999] if field in ("left_wrist", "weights") else [long] + [""] * 99_999
    for value in (many, [many] * 2, [[text.encode() for text in many[0]]] if isinstance(many[0], list) else [many]):
        document = solve_document() | {"verb": verb, field: value}
        if verb == "solve_batch":
            document = {k: ([v] if isinstance(v, list) and k != field else v) for k, v in document.items()}
        tracemalloc.start()
        try:
            with pytest.raises(RequestError):
                parse_request(document, N)
            assert tracemalloc.get_traced_memory()[1] < 20_000_000
        finally:
            tracemalloc.stop()


def test_openwbt_form_is_a_solve_and_its_extra_keys_are_ignored() -> None:
    body = json.dumps(
        {
            "left_wrist": T.tolist(),
            "right_wrist": T.tolist(),
            "current_lr_arm_q": Q.tolist(),
            "current_lr_arm_dq": [0.0] * N,
            "left_hand": [1, 2, 3],
        }
    ).encode()
    got = parse_request(JSON.decode(body), N)
    assert isinstance(got, SolveRequest)
    assert np.array_equal(got.q, Q)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no left wrist": (solve_document(left_wrist=...), "left_wrist is missing"),
    "3x3 pose": (solve_document(left_wrist=np.eye(3).tolist()), "left_wrist must have shape 4x4, not 3x3"),
    "13 joints": (solve_document(q=[0.0] * 13), "q must have shape 14, not 13"),
    "ragged": (solve_document(q=[[0.0], [0.0, 1.0]]), "q must be an array of numbers"),
    "text": (solve_document(q=["0"] * N), "q must be an array of numbers"),
    "booleans": (solve_document(q=[True] * N), "q must be an array of numbers"),
    "a number": (solve_document(q=1.0), "q must have shape 14, not of a single number"),
    "a mapping": (solve_document(q={"a": 1}), "q must be an array of numbers"),
    "huge integers": (solve_document(q=[10**400] * N), "q must be an array of numbers"),
    "NaN": (solve_document(dq=[float("nan")] + [0.0] * 13), "dq holds a number that is not finite"),
    "infinity": (solve_document(q=[float("inf")] + [0.0] * 13), "q holds a number that is not finite"),
    "degrees": (solve_document(q=[90.0] * N), "q is beyond 100"),
    "short bytes": (solve_document(q=b"12345"), "q must be raw float64 of shape 14, 5 bytes came"),
    "float32 bytes": (solve_document(q=np.zeros(N, "f4").tobytes()), "q must be raw float64 of shape 14, 56 bytes"),
    "reflection": (solve_document(right_wrist=np.diag([1, 1, -1, 1]).tolist()), "right_wrist is not a pose: .*reflec"),
    "misspelt field": (solve_document(presett="precise"), "solve has no field 'presett'"),
    "negative id": (solve_document(id=-1), "id must be an integer"),
    "boolean id": (solve_document(id=True), "id must be an integer"),
    "id beyond JSON": (solve_document(id=2**53), "id must be an integer"),
    "preset of another type": (solve_document(preset=7), "preset must be a string"),
    "unknown mode": (solve_document(mode="walk"), "mode 'walk' is not known, there are track, reach"),
    "mode of another type": (solve_document(mode=["reach"]), "mode must be a string, there are track, reach"),
    "unknown collision": (solve_document(collision="on"), "collision 'on' is not known, there are off, report, avoid"),
    "two waist joints": (solve_document(waist=[0.0, 0.0]), "waist must have shape 3, not 2"),
    "waist in degrees": (solve_document(waist=[0.0, 0.0, 180.0]), "waist is beyond 100"),
    "elbow without confidence": (solve_document(left_elbow=[0.0, 0.0, -1.0]), "left_elbow must have shape 4, not 3"),
    "elbow too sure": (solve_document(right_elbow=[0.0, 0.0, -1.0, 1.5]), "right_elbow has confidence 1.5"),
    "elbow nowhere": (solve_document(left_elbow=[0.0, 0.0, 0.0, 0.5]), "left_elbow points nowhere"),
    "NaN elbow": (solve_document(left_elbow=[float("nan"), 0.0, 1.0, 0.5]), "left_elbow holds a number that is not fi"),
    "four weights": (solve_document(weights=[1.0] * 4), "weights must have shape 2x2, not 4"),
    "heavy weights": (solve_document(weights=[[1.0, 1.0], [1.0, 50.0]]), "weights must hold factors from 0 to 1"),
    "no starts": (solve_document(starts=0), "starts must be an integer from 1 to 256"),
    "too many starts": (solve_document(starts=257), "starts must be an integer from 1 to 256"),
    "half a start": (solve_document(starts=1.5), "starts must be an integer from 1 to 256"),
    "true starts": (solve_document(starts=True), "starts must be an integer from 1 to 256"),
    "waist of fk": ({"verb": "fk", "q": Q.tolist(), "waist": [0.0]}, "waist must have shape 3, not 1"),
    "mode of fk": ({"verb": "fk", "q": Q.tolist(), "mode": "reach"}, "fk has no field 'mode'"),
    "preset of fk": ({"verb": "fk", "q": Q.tolist(), "preset": "openwbt"}, "fk has no field 'preset'"),
    "q of info": ({"verb": "info", "q": Q.tolist()}, "info has no field 'q'"),
    "strings in a pose": (
        solve_document(left_wrist=[["1"] * 4] * 3 + [[0, 0, 0, 1]]),
        "left_wrist must be an array of numbers",
    ),
    "booleans as a pose": (
        solve_document(left_wrist=np.eye(4, dtype=bool).tolist()),
        "left_wrist must be an array of num",
    ),
    "null in a pose": (
        solve_document(left_wrist=[[None] * 4] * 3 + [[0, 0, 0, 1]]),
        "left_wrist must be an array of numbers",
    ),
    "huge integers in a pose": (solve_document(left_wrist=[[10**400] * 4] * 3 + [[0, 0, 0, 1]]), "left_wrist"),
    "field of another verb": ({"verb": "fk", "q": Q.tolist(), "dq": Q.tolist()}, "fk has no field 'dq'"),
}


@pytest.mark.parametrize(("document", "words"), REFUSED.values(), ids=REFUSED.keys())
def test_a_bad_request_is_refused_in_one_line(document: dict[str, Any], words: str) -> None:
    """Hazard rows: NaN / Inf; malformed frame."""
    with pytest.raises(RequestError, match=words) as refusal:
        parse_request(document, N)
    assert refusal.value.status is Status.BAD_REQUEST
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "changes", [{"v": 2}, {"v": "1"}, {"verb": "dance"}, {"verb": ["solve"]}, {"verb": None}], ids=str
)
def test_an_unknown_verb_or_version_is_unsupported(changes: dict[str, Any]) -> None:
    with pytest.raises(RequestError) as refusal:
        parse_request(solve_document(**changes), N)
    assert refusal.value.status is Status.UNSUPPORTED


@pytest.mark.parametrize("field", ["v", "verb", "id", "q", "left_wrist", "mode", "weights", "other"])
def test_lists_nested_as_deep_as_a_codec_allows_are_refused(field: str) -> None:
    nested: list[Any] = []
    for _ in range(1019):
        nested = [nested]
    body = b'{"verb": "solve", "%s": %s%s}' % (field.encode(), b"[" * 1020, b"]" * 1020)
    for document in (JSON.decode(body), solve_document() | {field: nested}):
        with pytest.raises(RequestError) as refusal:
            parse_request(document, N)
        assert len(str(refusal.value)) < 200


def test_a_refusal_carries_what_could_be_read() -> None:
    with pytest.raises(RequestError) as refusal:
        parse_request(solve_document(left_wrist=[]), N)
    assert refusal.value.id == 5
    assert np.array_equal(refusal.value.q, Q)
    with pytest.raises(RequestError) as blind:
        parse_request(solve_document(q=[1], id="x"), N)
    assert blind.value.id == 0
    assert blind.value.q is None


def test_rotations_arrive_projected() -> None:
    """Hazard row: non-orthonormal / reflected; a rounding error is repaired, anything else is refused."""
    rounded = T.copy()
    rounded[:3, :3] += 1e-5
    got = parse_request(solve_document(left_wrist=rounded.tolist()), N)
    assert isinstance(got, SolveRequest)
    R = got.left_wrist[:3, :3]
    assert np.abs(R.T @ R - np.eye(3)).max() < 1e-14


any_value = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.binary(max_size=140),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=12,
)
plain_names = ["v", "id", "verb", "q", "dq", "left_wrist", "right_wrist", "preset"]
option_names = ["mode", "waist", "left_elbow", "right_elbow", "weights", "collision", "starts"]
envelope_names = ["token", "stream", "budget_ms"]
field_names = st.sampled_from([*plain_names, *option_names, *envelope_names, "current_lr_arm_q", "current_lr_arm_dq"])


@given(st.dictionaries(field_names | st.integers(), any_value, max_size=8), st.booleans())
def test_a_request_is_accepted_or_refused_and_nothing_else(changes: dict[Any, Any], onto_valid: bool) -> None:
    document = solve_document() | changes if onto_valid else changes
    try:
        request = parse_request(document, N)
    except RequestError as refusal:
        assert refusal.status in (Status.BAD_REQUEST, Status.UNSUPPORTED)
        assert len(str(refusal)) < 200
        return
    if isinstance(request, SolveRequest):
        assert all(np.isfinite(a).all() for a in (request.left_wrist, request.right_wrist, request.q, request.dq))


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
@given(body=st.binary(max_size=200))
def test_any_bytes_decode_or_raise_the_documented_error(codec: Codec, body: bytes) -> None:
    try:
        document = codec.decode(body)
    except DecodeError as error:
        assert "\n" not in str(error)
    else:
        assert isinstance(document, dict)


@pytest.mark.parametrize(
    ("codec", "body"),
    [
        (JSON, b"[" * 60000),
        (JSON, b'{"a":' * 12000),
        (MSGPACK, b"\x91" * 60000),
        (MSGPACK, b"\x81\xa1a" * 20000),
        (MSGPACK, b"\xdd\xff\xff\xff\xff"),
        (MSGPACK, b"\xc6\xff\xff\xff\xff"),
        (MSGPACK, b"\x80\x80"),
        (MSGPACK, b""),
        (JSON, b""),
        (JSON, b"\xff\xfe"),
    ],
)
def test_hostile_bodies_are_refused(codec: Codec, body: bytes) -> None:
    with pytest.raises(DecodeError):
        codec.decode(body)
