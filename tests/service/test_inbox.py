"""`Inbox` and `StreamQueue`: whatever comes in whatever pieces goes out once and in order, and marked rightly."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto import MAX_FRAME_BYTES, encode_frame
from ik_service.inbox import Inbox
from ik_service.stream_queue import StreamQueue, Waiting


def stream_of(body: bytes) -> str:
    return body.partition(b"/")[0].decode() if b"/" in body else ""


def inbox(most: int = 256, most_bytes: int = MAX_FRAME_BYTES) -> Inbox:
    return Inbox(stream_of, most, most_bytes)


bodies = st.lists(st.sampled_from([b"", b"plain", b"a/1", b"a/2", b"b/1"]) | st.binary(max_size=40), max_size=30)


@given(bodies=bodies, data=st.data(), most=st.integers(1, 5))
def test_everything_goes_out_once_in_order_however_it_came(bodies: list[bytes], data: st.DataObject, most: int) -> None:
    """Hazard row: malformed frame."""
    stream = b"".join(map(encode_frame, bodies))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    box, taken = Inbox(lambda _: "", most, 100), []
    for at, (begin, end) in enumerate(zip([0, *cuts], [*cuts, len(stream)], strict=True)):
        box.feed(stream[begin:end], float(at))
        taken += [box.take() for _ in range(data.draw(st.integers(0, len(box))))]
    while len(box):
        taken += [box.take()]
    numbered = [waiting.arrived for waiting in taken]
    assert [waiting.body for waiting in taken] == bodies
    assert numbered == sorted(numbered)
    assert not box.full
    assert not box.begun


@given(names=st.lists(st.sampled_from(["", "a", "b"]), max_size=12), taken_early=st.integers(0, 12))
def test_of_a_stream_all_that_wait_but_the_newest_are_superseded(names: list[str], taken_early: int) -> None:
    queue = StreamQueue(stream_of)
    for name in names:
        queue.put(Waiting(f"{name}/x".encode() if name else b"x", 0.0))
    later = names[:]
    for _ in range(min(taken_early, len(names))):
        name, later = later[0], later[1:]
        assert queue.take().superseded is (bool(name) and name in later)
    old = queue.take_superseded()
    expected = [name for k, name in enumerate(later) if name and name in later[k + 1 :]]
    assert [waiting.stream for waiting in old] == expected
    assert len(queue) == len(later) - len(old)
    assert not any(queue.take().superseded for _ in range(len(queue)))
    assert queue.size == 0


def test_what_is_taken_before_another_comes_is_not_looked_at() -> None:
    looked_at: list[bytes] = []
    queue = StreamQueue(lambda body: looked_at.append(body) or "")
    for body in (b"1", b"2"):
        queue.put(Waiting(body, 0.0))
        assert queue.take().body == body
    assert looked_at == []


def test_a_flood_of_tiny_frames_is_cut_only_as_it_is_taken() -> None:
    """Hazard row: slowloris / flood."""
    box = inbox(most=10)
    box.feed(encode_frame(b"") * 100_000, 0.0)
    assert box.full
    assert len(box) <= 10 + 16 * 1024 // 4
    for _ in range(100_000):
        assert box.take().body == b""
    assert not len(box)
    assert not box.full


def test_it_is_full_beyond_its_bytes_and_has_room_again() -> None:
    box = inbox(most_bytes=50)
    box.feed(encode_frame(b"x" * 60), 0.0)
    assert box.full
    box.feed(encode_frame(b"later"), 1.0)
    assert len(box) == 1
    assert box.take().body == b"x" * 60
    assert (len(box), box.full) == (1, False)


@pytest.mark.parametrize("before", [0, 300])
def test_a_length_beyond_the_limit_comes_after_what_was_before_it(before: int) -> None:
    """Hazard row: oversized frame."""
    box = inbox(most=10)
    box.feed(encode_frame(b"good") * before + struct.pack(">I", MAX_FRAME_BYTES + 1) + b"x" * 70_000, 0.0)
    for _ in range(before):
        assert box.take().body == b"good"
    assert box.fault is not None
    assert box.fault.length == MAX_FRAME_BYTES + 1
    assert not box.full


def test_a_frame_has_begun_until_its_last_byte() -> None:
    box = inbox()
    frame = encode_frame(b"z" * 40_000)
    box.feed(frame[:-1], 0.0)
    assert box.begun
    box.feed(frame[-1:], 7.0)
    assert not box.begun
    assert box.take().arrived == 7.0
