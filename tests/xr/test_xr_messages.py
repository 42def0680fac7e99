"""Messages, the slot with credits, and the page's clock."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ik_proto.stereo_packet import StereoFrame
from xr_client.messages import (
    MAX_MESSAGE_BYTES,
    ArmHud,
    Clear,
    Hello,
    Hud,
    MessageError,
    Pong,
    hud_message,
    ping_message,
    read_page_message,
    read_shown,
)
from xr_client.page_clock import PageClock
from xr_client.video_slot import CREDITS, VideoSlot


def frame(seq: int) -> StereoFrame:
    return StereoFrame(seq, 10.0 * seq, b"l%d" % seq, b"right%d" % seq)


def test_what_a_page_may_say():
    assert read_page_message('{"type": "hello", "page": "1", "device": "Quest 3"}') == Hello("1", "Quest 3")
    assert read_page_message('{"type": "pong", "t_ms": 1, "page_ms": 2.5}') == Pong(1.0, 2.5)
    assert read_page_message('{"type": "clear"}') == Clear()


def test_what_is_printed_of_a_device_is_one_line():
    assert read_page_message(json.dumps({"type": "hello", "page": "1", "device": "a\nb\x1b[2J"})) == Hello(
        "1", "a b [2J"
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must be JSON"),
        ("[]", "must be a JSON object"),
        ("[" * 4000, "must be JSON"),
        ("{}", "no message of type None"),
        ('{"type": "hud"}', "no message of type 'hud'"),
        ('{"type": ["hello"]}', "no message of type"),
        ('{"type": "pong", "t_ms": 1}', "'page_ms' is missing"),
        ('{"type": "pong", "t_ms": 1, "page_ms": 2, "more": 3}', "'more' is not known"),
        ('{"type": "pong", "t_ms": NaN, "page_ms": 2}', "t_ms must be a finite number"),
        ('{"type": "pong", "t_ms": 1e999, "page_ms": 2}', "t_ms must be a finite number"),
        ('{"type": "pong", "t_ms": true, "page_ms": 2}', "t_ms must be a finite number"),
        (f'{{"type": "pong", "t_ms": 1{"0" * 400}, "page_ms": 2}}', "t_ms must be a finite number"),
        (json.dumps({"type": "hello", "page": "1", "device": "x" * 201}), "at most 200 characters"),
        ('{"type": "clear"}' + " " * MAX_MESSAGE_BYTES, "at most 4096 bytes"),
    ],
)
def test_what_a_page_may_not_say(text, words):
    with pytest.raises(MessageError, match=words):
        read_page_message(text)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
kinds = st.sampled_from(["hello", "pong", "clear", "shown"])
fields = st.dictionaries(st.sampled_from(["page", "device", "t_ms", "page_ms", "seq", "other"]), json_values)


@given(
    st.text(max_size=200)
    | json_values.map(json.dumps)
    | st.builds(lambda t, f: json.dumps({"type": t} | f), kinds, fields)
)
def test_a_text_is_accepted_or_refused(text):
    for read, accepted in ((read_page_message, (Hello, Pong, Clear)), (read_shown, int)):
        try:
            assert isinstance(read(text), accepted)
        except MessageError as error:
            assert len(str(error).splitlines()) == 1


def test_what_the_server_says_is_json():
    hud = Hud(left=ArmHud("active", "", 1.5, 0.2), note="all is well", latency_ms={"solve": 0.1, "page": None})
    said = json.loads(hud_message(hud))
    assert said["type"] == "hud"
    assert said["left"] == {
        "state": "active",
        "reason": "",
        "position_error_mm": 1.5,
        "rotation_error_deg": 0.2,
        "warning": "",
        "changes": 0,
    }
    assert said["right"]["state"] == "disarmed"
    assert said["latency_ms"] == {"solve": 0.1, "page": None}
    assert json.loads(ping_message(3.5)) == {"type": "ping", "t_ms": 3.5}
    with pytest.raises(ValueError, match="JSON"):
        ping_message(float("nan"))


def test_the_latest_image_goes_next_and_credits_bound_what_is_under_way():
    slot = VideoSlot()
    sent = []
    for seq in range(10):
        slot.offer(frame(seq))
        sent.append(slot.take(0.0))
    assert [one.seq for one in sent if one] == [0, 1]
    assert slot.skipped == 7
    assert slot.acknowledge(0, 0.0) == 0.0
    latest = slot.take(0.0)
    assert latest is not None
    assert latest.seq == 9
    assert slot.take(0.0) is None


def test_an_image_is_worth_making_when_the_last_should_have_been_shown():
    """At once for a page that has none; then when the usual time has passed, so that images do not queue."""
    slot = VideoSlot()
    assert slot.worth_making(5.0) == 0.0
    slot.offer(frame(1))
    assert slot.worth_making(5.0) == math.inf  # it waits
    slot.take(5.0)
    assert slot.worth_making(9.0) == math.inf  # how long it takes is not known yet
    slot.acknowledge(1, 5.1)
    assert slot.worth_making(5.1) == 0.0
    slot.offer(frame(2))
    slot.take(6.0)
    assert slot.worth_making(6.0) == pytest.approx(0.1)
    assert slot.worth_making(6.06) == pytest.approx(0.04)
    assert slot.worth_making(6.12) == 0.0
    slot.offer(frame(3))
    slot.take(6.12)
    assert slot.worth_making(7.0) == math.inf  # no credit
    slot.acknowledge(2, 7.0)
    assert slot.worth_making(7.0) == 0.0


@given(st.lists(st.tuples(st.sampled_from(["offer", "take", "shown"]), st.integers(0, 30)), max_size=80))
def test_a_slot_never_has_more_under_way_than_credits_nor_goes_back(script):
    slot, seq, under_way, last = VideoSlot(), 0, set(), -1
    for action, number in script:
        if action == "offer":
            seq += 1
            slot.offer(frame(seq))
        elif action == "take" and (taken := slot.take(0.0)):
            assert taken.seq > last
            last = taken.seq
            under_way.add(last)
        elif action == "shown":
            assert (slot.acknowledge(number, 0.0) is not None) == (number in under_way)
            under_way.discard(number)
        assert len(under_way) <= CREDITS
    assert slot.sent - slot.shown == len(under_way)


@given(st.floats(-1e6, 1e6), st.lists(st.tuples(st.floats(0.0, 50.0), st.floats(0.0, 1.0)), min_size=1, max_size=40))
def test_the_pages_clock_is_right_to_half_the_shortest_round_trip(ahead, trips):
    """The path may be as lopsided as it likes; only the last 32 pongs are looked at."""
    clock, now = PageClock(), 1000.0
    for trip, share in trips:
        clock.pong(now, now + share * trip + ahead, now + trip)
        now += trip
    shortest = min(trip for trip, _ in trips[-32:])
    assert clock.round_trip_ms == pytest.approx(shortest, abs=1e-6)
    age = clock.age_ms(now - 7.0 + ahead, now)
    assert age == pytest.approx(7.0, abs=0.5 * shortest + 1e-6)


def test_a_clock_without_a_pong_says_nothing():
    clock = PageClock()
    clock.pong(10.0, 0.0, 9.0)  # answered before it was asked
    assert clock.age_ms(0.0, 0.0) is None
    assert clock.round_trip_ms is None
