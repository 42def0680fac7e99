"""The fuzzer's own parts: oracles that notice, writers that say what they are told, mutations that repeat."""

import json
import random
import struct
from collections.abc import Callable
from typing import Any

import pytest
import umsgpack

from benchmarks.fuzz.examples import replies, requests
from benchmarks.fuzz.hostile import Pairs, Raw, write_json, write_msgpack
from benchmarks.fuzz.mutator import Mutator
from benchmarks.fuzz.targets import Broken, Replies, Requests, Stream, expected_frames, pieces, require_one_line
from ik_proto import JSON, MSGPACK, Codec, DecodeError, SolveReply, Status, encode_frame, reply_document

CODECS = pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=lambda codec: codec.name)
INFO = b'{"verb": "info", "id": 5}'
BAD = b'{"verb": "info", "id": 5, "mode": 1}'


def refusal(status: Status = Status.BAD_REQUEST, error: str = "no", id: int = 5) -> dict[str, Any]:
    return reply_document(SolveReply(success=False, error=error, status=status, id=id, boot_id="b"))


def target(said: dict[str, Any]) -> Requests:
    return Requests(JSON, lambda body: JSON.encode(said), answered=1, validated=1)


def test_a_sound_refusal_passes() -> None:
    hostile = target(refusal())
    hostile(BAD)
    assert hostile.counts == {"refused: bad_request": 1, "answered: bad_request": 1}


@pytest.mark.parametrize(
    ("said", "complaint"),
    [
        (refusal(Status.INTERNAL), "the service failed"),
        (refusal(id=6), "request 5 got reply 6"),
        (refusal(error=""), "not one line"),
        (refusal(error="Traceback (most recent call last)"), "shows the inside"),
        (refusal(error="two\nlines"), "not one line"),
        (refusal(error="x" * 1000), "not one line"),
        (refusal(Status.OVERLOADED), "was answered overloaded"),
    ],
)
def test_a_wrong_answer_is_noticed(said: dict[str, Any], complaint: str) -> None:
    with pytest.raises(Broken, match=complaint):
        target(said)(BAD)


def test_an_accepted_request_that_is_refused_is_noticed() -> None:
    with pytest.raises(Broken, match="InfoRequest was answered bad_request"):
        target(refusal())(INFO)


def test_an_answer_that_does_not_fit_the_schema_is_noticed() -> None:
    with pytest.raises(Broken, match="no refusal by the schema: 'sol_q' is a required property"):
        target({key: value for key, value in refusal().items() if key != "sol_q"})(BAD)


def test_what_is_not_in_the_contract_escapes() -> None:
    def broken(body: bytes) -> dict[str, Any]:
        raise KeyError("q")

    for hostile in (Requests(Codec("json", JSON.encode, broken)), Replies(Codec("json", JSON.encode, broken))):
        with pytest.raises(KeyError):
            hostile(INFO)


@pytest.mark.parametrize("message", ["", "a\nb", "a\x00b", "see /usr/lib/python3/site-packages/x.py"])
def test_an_error_is_one_line_for_a_person(message: str) -> None:
    with pytest.raises(Broken):
        require_one_line(message)


def test_a_stream_is_cut_in_many_ways_and_comes_out_whole() -> None:
    streams = [encode_frame(INFO) * n + struct.pack(">I", 99) + b"x" * n for n in range(40)]
    assert len({len(pieces(stream)) for stream in streams}) > 5
    for stream in streams:
        assert b"".join(pieces(stream)) == stream
    hostile = Stream(Requests(JSON))
    for stream in streams:
        hostile(stream)
    assert hostile.frames == sum(range(40))
    assert expected_frames(encode_frame(INFO) + b"\xff\xff\xff\xff") == ([INFO], True)


@CODECS
@pytest.mark.parametrize("examples", [requests, replies])
def test_the_hostile_writers_write_sound_messages_too(codec: Codec, examples: Callable[[Codec], list[bytes]]) -> None:
    write, read = (write_json, json.loads) if codec is JSON else (write_msgpack, umsgpack.unpackb)
    for body in examples(codec):
        assert read(write(codec.decode(body))) == read(body)


def test_the_hostile_writers_write_what_no_honest_one_does() -> None:
    assert write_json({"q": [float("nan"), Raw(b"01")]}) == b'{"q":[NaN,01]}'
    assert write_json(Pairs([("q", 1), ("q", 2)])) == b'{"q":1,"q":2}'
    assert write_msgpack(Pairs([("q", 1), (2, Raw(b"\xc1"))])) == b"\x82\xa1q\x01\x02\xc1"


@CODECS
def test_the_same_seed_makes_the_same_bytes_and_most_of_them_decode(codec: Codec) -> None:
    def made() -> list[bytes]:
        mutator = Mutator(codec, requests(codec), random.Random(3))
        return [mutator.body() for _ in range(500)]

    def decodes(body: bytes) -> bool:
        try:
            codec.decode(body)
        except DecodeError:
            return False
        return True

    bodies = made()
    assert bodies == made()
    assert len(set(bodies)) > 450
    assert 300 < sum(map(decodes, bodies)) < 490
