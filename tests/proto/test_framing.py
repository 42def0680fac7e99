"""Frames survive any chopping of the stream, and an oversized length is refused before it costs memory."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto import FrameDecoder, FrameTooLarge, encode_frame


@given(st.lists(st.binary(max_size=50), max_size=8), st.data())
def test_any_chopping_gives_the_same_frames(bodies: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(encode_frame(body) for body in bodies)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    decoder, received = FrameDecoder(), []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        received += decoder.feed(stream[start:end])
    assert received == bodies
    assert not decoder.pending


def test_header_is_a_big_endian_length() -> None:
    assert encode_frame(b"x" * 258) == b"\x00\x00\x01\x02" + b"x" * 258


def test_an_unfinished_frame_is_pending() -> None:
    decoder = FrameDecoder()
    assert decoder.feed(b"\x00\x00") == []
    assert decoder.pending
    assert decoder.feed(b"\x00\x01a\x00") == [b"a"]
    assert decoder.pending


@pytest.mark.parametrize("split", [False, True], ids=["at once", "byte by byte"])
def test_a_length_beyond_the_limit_is_refused_with_what_came_before(split: bool) -> None:
    """Hazard row: oversized frame."""
    decoder = FrameDecoder(limit=16)
    stream = encode_frame(b"good") + b"\xff\xff\xff\xff junk"
    pieces = [stream[i : i + 1] for i in range(len(stream))] if split else [stream]
    received: list[bytes] = []

    def feed_all() -> None:
        for piece in pieces:
            received.extend(decoder.feed(piece))

    with pytest.raises(FrameTooLarge) as refusal:
        feed_all()
    assert received + refusal.value.frames_before == [b"good"]
    assert refusal.value.length == 2**32 - 1
    assert refusal.value.limit == 16


def test_a_frame_at_the_limit_is_accepted_and_one_byte_more_is_not() -> None:
    assert FrameDecoder(limit=16).feed(encode_frame(b"x" * 16)) == [b"x" * 16]
    with pytest.raises(FrameTooLarge):
        FrameDecoder(limit=16).feed(encode_frame(b"x" * 17))
