"""Whatever a document holds, it is accepted or refused by a documented error of one line, by either codec and side.

Hazard rows: malformed frame; NaN / Inf; non-orthonormal; oversized frame.
"""

import json
import struct
import tracemalloc
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.fuzz.examples import replies, requests
from benchmarks.fuzz.hostile import Pairs, Raw, write_json, write_msgpack
from benchmarks.fuzz.targets import Replies, Requests, Stream
from benchmarks.fuzz.wild import JSON_VALUES, MSGPACK_VALUES, NUMBERS, WORDS
from ik_proto import (
    JSON,
    MSGPACK,
    Codec,
    DecodeError,
    Document,
    FrameDecoder,
    FrameTooLarge,
    ReplyError,
    RequestError,
    SolveBatchRequest,
    SolveRequest,
    parse_batch_reply,
    parse_info_reply,
    parse_request,
    parse_solve_reply,
)
from ik_proto.limits import MAX_FRAME_BYTES, ROTATION_TOLERANCE

CODECS = pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
WRITE = {"json": write_json, "msgpack": write_msgpack}

strange = st.sampled_from([*NUMBERS, *WORDS]) | st.floats() | st.integers() | st.booleans() | st.none() | st.text()
json_leaves = strange | st.sampled_from(JSON_VALUES)
msgpack_leaves = (
    strange
    | st.sampled_from(MSGPACK_VALUES)
    | st.binary(max_size=130)
    | st.builds(msgpack.ExtType, st.integers(0, 127), st.binary(max_size=20))
)


def documents(leaves: st.SearchStrategy[Any], codec: Codec) -> st.SearchStrategy[Any]:
    """A sound message with a few fields replaced by anything, or anything at all."""
    anything = st.recursive(
        leaves,
        lambda inner: (
            st.lists(inner, max_size=5)
            | st.dictionaries(st.sampled_from(WORDS) | st.text(max_size=5), inner, max_size=5)
            | st.lists(st.tuples(leaves, inner), max_size=3).map(Pairs)
        ),
        max_leaves=12,
    )
    sound = st.sampled_from([codec.decode(body) for body in requests(codec) + replies(codec)])
    changes = st.dictionaries(st.sampled_from(WORDS), anything, max_size=3)
    return st.builds(lambda document, change: document | change, sound, changes) | anything


def stream_solve(codec: Codec) -> Document:
    """A sound solve of a stream."""
    return next(found for body in requests(codec) if "stream" in (found := codec.decode(body)))


DOCUMENTS = {"json": documents(json_leaves, JSON), "msgpack": documents(msgpack_leaves, MSGPACK)}


@CODECS
@settings(max_examples=100)
@given(data=st.data())
def test_a_document_of_anything_is_accepted_or_refused(codec: Codec, data: st.DataObject) -> None:
    body = WRITE[codec.name](data.draw(DOCUMENTS[codec.name]))
    Requests(codec)(body)
    Replies(codec)(body)


@settings(max_examples=100)
@given(stream=st.lists(st.binary(max_size=20) | st.binary(max_size=20).map(lambda b: struct.pack(">I", len(b)) + b)))
def test_a_stream_of_anything_is_cut_as_it_says(stream: list[bytes]) -> None:
    Stream(Requests(JSON))(b"".join(stream))


@pytest.mark.parametrize("depth", [100, 1000, 100_000])
def test_deep_nests_are_refused(depth: int) -> None:
    for codec, body in (
        (JSON, b"[" * depth + b"]" * depth),
        (JSON, b'{"q":' * depth + b"0" + b"}" * depth),
        (MSGPACK, b"\x91" * depth + b"\xc0"),
        (MSGPACK, b"\x81\xa1q" * depth + b"\xc0"),
    ):
        with pytest.raises((DecodeError, RequestError)) as caught:
            parse_request(codec.decode(body), 14)
        assert len(str(caught.value)) < 200


def test_arrays_that_lie_about_their_length_cost_no_memory() -> None:
    """Room for an array is made when its length is read: nested lies took gigabytes, and everybody's time."""
    length = 60_000
    body = (b"\xdd" + struct.pack(">I", length)) * 1000 + b"\xc0" * length
    tracemalloc.start()
    try:
        with pytest.raises(DecodeError, match="not MessagePack"):
            MSGPACK.decode(body)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 20 * len(body)


def test_the_largest_batch_of_lists_is_still_read() -> None:
    rows = {name: [value] * 1024 for name, value in stream_solve(JSON).items() if isinstance(value, list)}
    request = parse_request(MSGPACK.decode(write_msgpack({**rows, "verb": "solve_batch"})), 14)
    assert isinstance(request, SolveBatchRequest)
    assert len(request.q) == 1024


@pytest.mark.parametrize("number", [10**400, -(10**400), 2**64, 1e308], ids=["googol4", "-googol4", "2^64", "1e308"])
def test_numbers_beyond_everything_are_refused_where_they_stand(number: float) -> None:
    document = stream_solve(JSON)
    for field in ("q", "left_wrist"):
        spoiled = json.loads(json.dumps(document[field]))
        (spoiled if field == "q" else spoiled[0])[3] = number
        with pytest.raises(RequestError, match=field):
            parse_request(JSON.decode(write_json(document | {field: spoiled})), 14)
    with pytest.raises(RequestError, match="id must be"):
        parse_request(JSON.decode(write_json(document | {"id": number})), 14)


@CODECS
@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_no_number_that_is_not_finite_gets_anywhere(codec: Codec, number: float) -> None:
    """Hazard row: NaN / Inf."""
    write = WRITE[codec.name]
    for body in requests(codec):
        document = codec.decode(body)
        for field, value in document.items():
            if not isinstance(value, list | bytes):
                continue
            array = np.array(value) if codec is JSON else np.frombuffer(value, "<f8")
            for index in range(array.size):
                spoiled = array.astype(float).copy()
                spoiled.flat[index] = number
                with pytest.raises(RequestError, match=field.removeprefix("current_lr_arm_")):
                    parse_request(codec.decode(write(document | {field: spoiled.tolist()})), 14)


@CODECS
def test_what_is_no_rotation_is_refused_and_what_nearly_is_one_comes_out_as_one(codec: Codec) -> None:
    """Hazard row: non-orthonormal. Two of these pass the checks of well-known libraries: rank one, and a reflection."""
    document = stream_solve(codec)
    eye = np.eye(3)
    shear = eye + np.outer([1.0, 0.0, 0.0], [0.0, 0.01, 0.0])
    for R in (np.full((3, 3), 3.0**-0.5), np.diag([1.0, 1.0, -1.0]), -eye, 2.0 * eye, shear, np.zeros((3, 3))):
        T = np.eye(4)
        T[:3, :3] = R
        with pytest.raises(RequestError, match="left_wrist is not a pose"):
            parse_request(codec.decode(WRITE[codec.name](document | {"left_wrist": T.tolist()})), 14)
    T = np.eye(4)
    T[:3, :3] += 0.4 * ROTATION_TOLERANCE * np.outer([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    request = parse_request(codec.decode(WRITE[codec.name](document | {"left_wrist": T.tolist()})), 14)
    assert isinstance(request, SolveRequest)
    R = request.left_wrist[:3, :3]
    assert np.abs(R.T @ R - eye).max() < 1e-12
    assert np.linalg.det(R) > 0.0


def test_of_a_key_that_is_sent_twice_the_last_counts() -> None:
    twice = Pairs([("verb", "info"), ("id", 1), ("id", 2)])
    assert JSON.decode(write_json(twice)) == MSGPACK.decode(write_msgpack(twice)) == {"verb": "info", "id": 2}


@pytest.mark.parametrize(
    "text", [b'"\\ud800"', b'"\\udfff\\ud800"', b'["\\ud83d"]', b'{"\\udead": 1}', b'"\xed\xa0\x80"'], ids=repr
)
def test_half_a_surrogate_pair_is_no_text(text: bytes) -> None:
    """Python's `json` reads it, and nothing can write it again: no reply, no log, no terminal."""
    with pytest.raises(DecodeError):
        JSON.decode(b'{"error_msg": %b, "solve_us": NaN}' % text)
    with pytest.raises(DecodeError):
        JSON.decode(b'{"error_msg": %b}' % text)
    assert JSON.decode(b'{"error_msg": "\\ud83d\\ude00", "solve_us": Infinity}')["error_msg"] == "\U0001f600"


@pytest.mark.parametrize(
    "value",
    [
        msgpack.ExtType(5, bytes(112)),
        msgpack.Timestamp(1, 2),
        bytes(111),
        bytes(7),
        [bytes(8)] * 14,
        "0" * 14,
        {"0": 1.0},
        Raw(b"\xd7\xff" + b"\xff" * 8),
        Raw(b"\xc7\x0c\xff" + b"\xff" * 12),
    ],
    ids=["ext", "timestamp", "odd bin", "short bin", "list of bins", "text", "map", "bad timestamp", "worse timestamp"],
)
def test_what_is_no_array_in_messagepack_is_refused(value: Any) -> None:
    document = stream_solve(MSGPACK)
    for field in ("q", "dq", "left_wrist", "id", "preset", "verb"):
        if not (field == "preset" and isinstance(value, str)):
            with pytest.raises((DecodeError, RequestError)):
                parse_request(MSGPACK.decode(write_msgpack(document | {field: value})), 14)


@pytest.mark.parametrize("key", [1, None, 1.5, [], {}, True, msgpack.Timestamp(0)], ids=repr)
def test_keys_that_are_no_text_are_refused(key: Any) -> None:
    with pytest.raises((DecodeError, RequestError)):
        parse_request(MSGPACK.decode(write_msgpack(Pairs([("verb", "info"), (key, 1)]))), 14)


@pytest.mark.parametrize("field", ["iterations", "protocol"])
@pytest.mark.parametrize("number", [1e75, 2**64, -1, 0.5, True, None])
def test_a_count_in_a_reply_is_a_count(field: str, number: float) -> None:
    read = parse_info_reply if field == "protocol" else lambda document: parse_solve_reply(document, 14)
    documents = [JSON.decode(body) for body in replies(JSON)]
    document = next(document for document in documents if field in document and "statuses" not in document)
    read(document)
    with pytest.raises(ReplyError, match=f"{field} must be an integer"):
        read(document | {field: number})


@pytest.mark.parametrize("start", [-1, 2**53, 10**30, True, 0.5, "0"])
def test_a_list_of_counts_in_a_reply_is_one(start: Any) -> None:
    document = next(document for document in map(JSON.decode, replies(JSON)) if "statuses" in document)
    parse_batch_reply(document, 2, 14)
    with pytest.raises(ReplyError, match="start must hold integers"):
        parse_batch_reply(document | {"start": [0, start]}, 2, 14)


@pytest.mark.parametrize("length", [MAX_FRAME_BYTES + 1, 2**31, 2**32 - 1])
def test_a_length_beyond_the_limit_is_refused_before_anything_is_stored(length: int) -> None:
    """Hazard row: oversized frame."""
    decoder = FrameDecoder()
    tracemalloc.start()
    try:
        with pytest.raises(FrameTooLarge):
            decoder.feed(struct.pack(">I", length))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 100_000
    assert not decoder.pending
