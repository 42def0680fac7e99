"""Pose packets: accepted, or a documented error; one encoding for every content."""

import importlib.util
import json
import struct
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from xr_samples import at, controller, hand, packet

from xr_client.packet_order import PacketOrder
from xr_client.packets import (
    BASE_BYTES,
    JOINT_BYTES,
    MAX_PACKET_BYTES,
    HandPacket,
    Kind,
    PacketError,
    PosePacket,
    decode_packet,
    encode_packet,
)

VECTORS = Path(__file__).parent / "vectors"
ACCEPTED = json.loads((VECTORS / "accepted.json").read_text())["pose"]
REFUSED = json.loads((VECTORS / "refused.json").read_text())

units = st.floats(0.0, 1.0, width=32)
places = st.lists(st.floats(-100.0, 100.0, width=32), min_size=3, max_size=3)


@st.composite
def placements(draw):
    """Position and unit quaternion, exact in float32; None sometimes."""
    q = np.array(draw(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4)))
    norm = np.linalg.norm(q)
    if norm < 0.1 or draw(st.booleans()):
        return None
    return np.array([*draw(places), *q / norm]).astype(np.float32).astype(np.float64)


@st.composite
def hands(draw):
    kind = draw(st.sampled_from(Kind))
    if kind is Kind.NONE:
        return HandPacket()
    if kind is Kind.CONTROLLER:
        stick = draw(units), -draw(units)
        return HandPacket(
            kind, draw(placements()), draw(units), draw(units), stick, draw(st.tuples(*[st.booleans()] * 3))
        )
    joints = np.array(draw(places)) * np.linspace(-1, 1, 25)[:, None] if draw(st.booleans()) else None
    joints = None if joints is None else joints.astype(np.float32).astype(np.float64)
    return HandPacket(kind, draw(placements()), pinch=draw(st.none() | units), joints=joints)


@st.composite
def packets(draw):
    head = draw(placements())
    return PosePacket(
        draw(st.integers(0, 2**32 - 1)),
        draw(st.integers(0, 2**32 - 1)),
        draw(st.floats(allow_nan=False, allow_infinity=False)),
        head,
        head is not None and draw(st.booleans()),
        draw(st.booleans()),
        draw(hands()),
        draw(hands()),
    )


def content(value: PosePacket) -> dict:
    return json.loads(json.dumps(asdict(value), default=lambda array: array.tolist()))


@given(packets())
def test_what_is_encoded_is_decoded(value):
    assert content(decode_packet(encode_packet(value))) == content(value)


@given(st.binary(max_size=MAX_PACKET_BYTES + 8) | st.binary(min_size=BASE_BYTES, max_size=BASE_BYTES))
def test_bytes_are_accepted_or_refused(data):
    accepted_or_refused(data)


@given(packets(), st.data())
def test_spoiled_packets_are_accepted_or_refused(value, data):
    """Bits flipped and bytes cut off: nothing but `PacketError`, and what is accepted has this very encoding."""
    spoilt = bytearray(encode_packet(value))
    for _ in range(data.draw(st.integers(1, 4))):
        spoilt[data.draw(st.integers(0, len(spoilt) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    accepted_or_refused(bytes(spoilt))
    accepted_or_refused(bytes(spoilt[: data.draw(st.integers(0, len(spoilt)))]))


def accepted_or_refused(data: bytes) -> None:
    try:
        value = decode_packet(data)
    except PacketError as error:
        assert len(str(error).splitlines()) == 1
        return
    assert encode_packet(value) == data
    for pose in (value.head, value.left.pose, value.right.pose):
        if pose is not None:
            assert np.isfinite(pose).all()
            assert abs(np.linalg.norm(pose[3:]) - 1.0) <= 1e-2


@pytest.mark.parametrize("vector", ACCEPTED, ids=[vector["name"] for vector in ACCEPTED])
def test_a_golden_vector_is_read(vector):
    data = bytes.fromhex(vector["hex"])
    assert content(decode_packet(data)) == vector["content"]
    assert encode_packet(decode_packet(data)) == data


@pytest.mark.parametrize("vector", REFUSED, ids=[vector["name"] for vector in REFUSED])
def test_a_golden_vector_is_refused(vector):
    with pytest.raises(PacketError):
        decode_packet(bytes.fromhex(vector["hex"]))


def test_the_golden_vectors_are_what_their_program_writes():
    spec = importlib.util.spec_from_file_location("make_xr_vectors", VECTORS / "make.py")
    assert spec is not None
    assert spec.loader is not None
    make = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(make)
    for name, text in make.documents().items():
        assert (VECTORS / name).read_text() == text


def test_the_table_of_offsets():
    """By hand, without the code: the fields are where the documentation says."""
    head, left, right = at(1.0, 2.0, 3.0), at(4.0, 5.0, 6.0), at(7.0, 8.0, 9.0)
    joints = np.full((25, 3), 0.5)
    data = encode_packet(
        PosePacket(
            11,
            12,
            13.5,
            head,
            False,
            True,
            controller(left, 0.25),
            HandPacket(Kind.HAND, right, pinch=0.125, joints=joints),
        )
    )
    assert len(data) == BASE_BYTES + JOINT_BYTES == 448
    assert data[:8] == bytes([0x50, 1, 1 | 4, 1 | 4, 1 | 2 | 8 | 16, 0, 0, 0])
    assert struct.unpack_from("<IId", data, 8) == (11, 12, 13.5)
    assert struct.unpack_from("<7f", data, 24) == tuple(head)
    assert struct.unpack_from("<12f", data, 52) == (*left, 0.0, 0.25, 0.0, 0.0, 0.0)
    assert struct.unpack_from("<12f", data, 100) == (*right, 0.0, 0.0, 0.0, 0.0, 0.125)
    assert struct.unpack_from("<75f", data, 148) == (0.5,) * 75


def test_a_float32_pose_keeps_its_accuracy():
    """A wrist goes through a packet with less than 1e-6 m and 1e-6 rad of error."""
    rng = np.random.default_rng(3)
    for _ in range(40):
        q = rng.normal(size=4)
        pose = np.array([*rng.uniform(-2, 2, 3), *q / np.linalg.norm(q)])
        got = decode_packet(encode_packet(packet(1, left=hand(pose)))).left.pose
        assert got is not None
        assert np.abs(got - pose).max() < 2e-7


@pytest.mark.parametrize("field", ["seq", "epoch"])
@pytest.mark.parametrize("value", [-1, 2**32])
def test_counts_out_of_range_are_not_encoded(field, value):
    with pytest.raises(PacketError, match="whole numbers"):
        encode_packet(replace(packet(1), **{field: value}))


def test_what_would_be_refused_is_not_encoded():
    with pytest.raises(PacketError, match="unit length"):
        encode_packet(packet(1, left=controller(at() * 2.0)))


@given(st.lists(st.tuples(st.integers(0, 20), st.integers(0, 3)), max_size=60))
def test_accepted_packets_rise(numbers):
    """Shuffled, doubled, replayed: what is taken has rising numbers and epochs that never sink; all is counted."""
    order = PacketOrder()
    taken = [(seq, epoch) for seq, epoch in numbers if order.accepts(packet(seq, epoch=epoch))]
    for (seq, epoch), (next_seq, next_epoch) in pairwise(taken):
        assert next_seq > seq
        assert next_epoch >= epoch
    assert order.accepted == len(taken)
    assert order.dropped == len(numbers) - len(taken)
    if taken:
        assert order.missed == taken[-1][0] - taken[0][0] + 1 - len(taken)
