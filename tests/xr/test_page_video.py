"""Images on their way from the server to the eyes: the real socket, a real browser, and JPEGs good and bad."""

import io
from dataclasses import replace
from typing import Any

import pytest
from picture_rig import AHEAD, Rig
from PIL import Image
from xr_page import PageServer

from ik_proto.stereo_packet import StereoFrame

pytest_plugins = ["picture_fixtures"]


def jpeg(color: tuple[int, int, int]) -> bytes:
    data = io.BytesIO()
    Image.new("RGB", (64, 48), color).save(data, "JPEG")
    return data.getvalue()


def stereo(seq: int, **others: Any) -> StereoFrame:
    """Red for the left eye and blue for the right one, unless told otherwise."""
    return replace(StereoFrame(seq, 0.0, jpeg((200, 0, 0)), jpeg((0, 0, 200)), 60.0), **others)


def test_each_eye_sees_its_own_image(rig):
    rig.connect()
    rig.until("rig.link.state.open")
    rig.host.video.publish(stereo(7))
    rig.until("rig.draw() === 7")
    rig.draw(200.0)
    left, right = rig.picture("left"), rig.picture("right")
    assert rig.pixel(AHEAD, eye="left")[:3] == pytest.approx([200, 0, 0], abs=8)
    assert rig.pixel(AHEAD, eye="right")[:3] == pytest.approx([0, 0, 200], abs=8)
    assert not (left[..., 2] > left[..., 0] + 100).any()
    assert not (right[..., 0] > right[..., 2] + 100).any()
    rig.until("rig.link.count.shown === 1")


def test_a_stalled_page_gets_no_queue_and_goes_on_with_the_newest(rig):
    rig.connect()
    rig.until("rig.link.state.open")
    # Twice, as a credit that did not come back would be missed in the second stall.
    for first in (1, 101):
        before = rig.js("rig.link.count")
        for more in (1, 2):
            rig.host.video.publish(stereo(first + more))
            rig.until(f"rig.link.count.received === {before['received'] + more}")
        for seq in range(first + 3, first + 20):
            rig.host.video.publish(stereo(seq))
        stalled = rig.js("rig.link.count")
        assert (stalled["received"], stalled["shown"]) == (before["received"] + 2, before["shown"])
        rig.until(f"rig.draw() === {first + 19}")
        assert rig.js("rig.link.count.received") <= before["received"] + 4


def test_the_server_hears_of_it_after_the_drawing_and_may_come_back(rig, picture_folder):
    own = PageServer(folder=picture_folder)
    ports = own.start()
    try:
        rig = Rig(rig.tab, own)
        rig.open()
        rig.connect()
        rig.until("rig.link.state.open")
        own.video.publish(stereo(1))
        rig.until("rig.link.count.received === 1")
        own.video.publish(stereo(2))
        rig.until("rig.link.count.received === 2")
        assert own.video.shown_ms is None
        rig.until("rig.draw() === 2")
        own.video.publish(stereo(3))
        rig.until("rig.link.count.received === 3")  # so the credits have come back
        assert own.video.shown_ms is not None
        # It ends, and another one begins at the same place.
        own.stop()
        rig.until("!rig.link.state.open")
        assert rig.js("rig.link.state.reason") == "ik-xr has ended"
        rig.js("rig.draw()")  # acknowledges nothing to nobody
        own = PageServer(folder=picture_folder)
        own.start(*ports)
        rig.until("rig.link.state.open")
        own.video.publish(stereo(1, left=jpeg((0, 200, 0))))
        rig.until("rig.draw() === 1")
        assert rig.pixel(AHEAD)[:3] == pytest.approx([0, 200, 0], abs=8)
    finally:
        own.stop()


def test_what_cannot_be_decoded_gives_its_credit_back(rig):
    rig.connect()
    rig.until("rig.link.state.open")
    for seq, bad in enumerate(({"left": b"no JPEG"}, {"right": b"no JPEG"}, {"right": jpeg((0, 0, 0))[:80]}), start=1):
        rig.host.video.publish(stereo(seq, **bad))
        rig.until(f"rig.link.count.undecodable === {seq}")
    rig.host.video.publish(stereo(4))
    rig.until("rig.draw() === 4")
    assert rig.js("rig.link.count") == {"received": 4, "shown": 1, "undecodable": 3}


def test_a_wrong_token_is_said_and_not_tried_again(rig):
    rig.tab.requests.clear()
    rig.connect("wrong")
    rig.until("rig.link.state.reason.startsWith('wrong token')")
    # One that only lost its server connects a second time meanwhile.
    rig.js("rig.other = new rig.link.constructor('ws://' + location.host + '/nowhere', {onFrame: null}); 0")
    rig.until("rig.other._pause >= 1000")
    assert sum("/video" in url for url in rig.tab.requests) == 1


def test_a_packet_of_another_version_says_reload(rig):
    rig.connect()
    rig.until("rig.link.state.open")
    rig.js("rig.link._socket.onmessage({ data: new ArrayBuffer(40) })")
    rig.until("rig.link.state.reason.includes('reload the page')")
    assert not rig.js("rig.link.state.open")
