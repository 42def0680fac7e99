"""The stereo packet: the golden one, bytes that are none, frames that cannot become one."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto.stereo_packet import StereoError, StereoFrame, decode_frame, encode_frame

GOLDEN = json.loads((Path(__file__).parents[1] / "xr" / "vectors" / "accepted.json").read_text())["video"]
DATA = bytes.fromhex(GOLDEN["hex"])
HEAD_BYTES = 24


def test_the_golden_packet():
    content = GOLDEN["content"]
    frame = decode_frame(DATA)
    assert frame == StereoFrame(**content | {side: content[side].encode() for side in ("left", "right")})
    assert encode_frame(frame) == DATA
    assert frame.fov_deg == 60.25


@given(st.binary(max_size=80) | st.binary(max_size=40).map(lambda data: DATA[:HEAD_BYTES] + data))
def test_bytes_are_a_packet_or_refused(data):
    try:
        assert encode_frame(decode_frame(data)) == data
    except StereoError as error:
        assert len(str(error).splitlines()) == 1


@given(st.integers(0, HEAD_BYTES - 1), st.integers(0, 255))
def test_a_head_with_another_byte_is_a_packet_or_refused(place, byte):
    data = DATA[:place] + bytes([byte]) + DATA[place + 1 :]
    try:
        assert encode_frame(decode_frame(data)) == data
    except StereoError as error:
        assert len(str(error).splitlines()) == 1


@given(
    st.integers(0, 2**32 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.binary(min_size=1, max_size=50),
    st.binary(min_size=1, max_size=50),
    st.integers(0, 17_999),
)
def test_a_frame_arrives_as_it_was_sent(seq, taken_ms, left, right, fov):
    frame = StereoFrame(seq, taken_ms, left, right, fov / 100.0)
    assert decode_frame(encode_frame(frame)) == frame


@pytest.mark.parametrize(
    "spoilt",
    [
        {"left": b""},
        {"right": bytes((1 << 20) + 1)},
        {"seq": -1},
        {"seq": 2**32},
        {"taken_ms": float("inf")},
        {"fov_deg": -1.0},
        {"fov_deg": 180.0},
        {"fov_deg": float("nan")},
    ],
)
def test_what_is_no_packet_is_not_encoded(spoilt):
    with pytest.raises(StereoError) as error:
        encode_frame(StereoFrame(**{"seq": 1, "taken_ms": 0.0, "left": b"l", "right": b"r"} | spoilt))
    assert "\n" not in str(error.value)
