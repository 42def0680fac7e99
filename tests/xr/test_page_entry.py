"""What a person reads before VR, what fails in words, and the way in and out."""

import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from chromium import Chromium, Tab
from xr_page import TOKEN, wait_for

from xr_client.door import Door
from xr_client.iwer import iwer_script
from xr_client.messages import ArmHud, Hud
from xr_client.packets import PosePacket, decode_packet
from xr_client.pages import Pages
from xr_client.pose_socket import PoseSocket
from xr_client.server import Place, XrServer
from xr_client.tracker import Tracker
from xr_client.video_socket import VideoSocket

ENTER = "#enter-vr"
FAULTY = Hud(
    ArmHud("fault", "the robot does not follow"), ArmHud("active", "", 3.4, 1.0), "", {"service": 1.2, "command": 11.0}
)


FIRST_PAUSE = 250
"""Before a connection is tried again [ms]."""
PAUSES = """
  globalThis.pauses = [];
  const { setTimeout: later } = globalThis;
  globalThis.setTimeout = (work, ms, ...rest) => { pauses.push(ms); return later(work, ms, ...rest); };
"""
"""Keeps what a page waits for."""
HURRY = """
  globalThis.skipped = 0;
  const now = performance.now.bind(performance);
  performance.now = () => now() + skipped;
"""
"""Lets a page's clock be put forward."""


class Rig:
    """A server as `ik-xr` opens it, and what reaches it."""

    def __init__(self, token: str = TOKEN) -> None:
        door = Door(token, [])
        self.hud = Hud()
        self.cleared = threading.Event()
        self.speaks = threading.Event()
        self.speaks.set()
        self.packets: list[PosePacket] = []
        self._seen = 0
        self.pose = PoseSocket(
            door,
            Tracker(),
            hud=self._hud,
            clear=self.cleared.set,
            record=lambda data, _now: self.packets.append(decode_packet(data)),
        )
        self.video = VideoSocket(door)
        self._server = XrServer(Pages(emulator=iwer_script()), self.pose, self.video)

    def start(self, port: int = 0) -> int:
        (port,) = self._server.start(Place("127.0.0.1", port))
        self.url = f"http://127.0.0.1:{port}"
        return port

    def stop(self) -> None:
        self._server.stop()

    def _hud(self) -> Hud:
        """The HUD; a server that does not speak does nothing else either."""
        self.speaks.wait(30.0)
        return self.hud

    def packet(self, condition: Callable[[PosePacket], Any]) -> PosePacket:
        """Wait for a packet after those that were asked for before."""

        def found() -> PosePacket | None:
            while self._seen < len(self.packets):
                self._seen += 1
                if condition(self.packets[self._seen - 1]):
                    return self.packets[self._seen - 1]
            return None

        return wait_for(found, "a packet")


@pytest.fixture(scope="module")
def desk(iwer) -> Iterator[Rig]:
    """A server for tests that open pages of their own."""
    made = Rig()
    made.start()
    yield made
    made.stop()


@pytest.fixture(scope="module")
def rig(iwer) -> Iterator[Rig]:
    """The server of `worn`; another page would take its connection over."""
    made = Rig()
    made.start()
    yield made
    made.stop()


@pytest.fixture(scope="module")
def worn(rig, chromium) -> Iterator[Tab]:
    """A tab for the tests that enter and leave."""
    with opened(chromium, f"{rig.url}/emulate#{TOKEN}") as tab:
        yield tab


def says(tab: Tab, words: str, where: str = "body") -> None:
    """Wait until a person reads something."""
    wait_for(lambda: words in tab.text(where), f"{words!r} in {where}")


def holds(tab: Tab, expression: str) -> None:
    """Wait until an expression is true."""
    wait_for(lambda: tab.js(expression), expression)


def ready(tab: Tab) -> None:
    holds(tab, f"!document.querySelector('{ENTER}').disabled")


@contextmanager
def opened(chromium: Chromium, url: str, before: str = "") -> Generator[Tab]:
    with chromium.tab(1024, 768) as tab:
        if before:
            tab.before(before)
        tab.goto(url)
        yield tab


def test_without_a_token_it_says_where_to_get_one_and_does_not_connect(desk, chromium):
    with opened(chromium, f"{desk.url}/emulate") as tab:
        says(tab, "Open the whole address that ik-xr printed", "#checks")
        says(tab, "the address has no token", "#connection")
        says(tab, "not ready", "#enter-why")
        assert tab.js("[...document.querySelectorAll('#enter-vr, #enter-ar')].every((each) => each.disabled)")
        assert not any(request.startswith("ws") for request in tab.requests)
        # The way out: the same address with the token, which a browser does not load anew by itself.
        tab.goto(f"{desk.url}/emulate#{TOKEN}")
        says(tab, "connected to ik-xr", "#connection")


def test_a_wrong_token_is_said_once_and_not_tried_again(desk, chromium):
    with opened(chromium, f"{desk.url}/emulate#wrong", PAUSES) as tab:
        says(tab, "wrong token: ik-xr was started anew", "#connection")
        says(tab, "Not connected", "#enter-why")
        assert tab.js("ikxr.link.refused && document.querySelector('#connect').hidden")
        assert len([request for request in tab.requests if "/pose?" in request]) == 1
        assert FIRST_PAUSE not in tab.js("pauses")


def test_without_webxr_it_names_browsers_that_have_it(desk, chromium):
    with opened(chromium, f"{desk.url}/#{TOKEN}", "delete Navigator.prototype.xr") as tab:
        says(tab, "This browser has no WebXR", "#checks")
        says(tab, "connected to ik-xr", "#connection")
        assert tab.js(f"document.querySelector('{ENTER}').disabled")
        # What is missing stands before the robot's state.
        assert tab.text("main").index("This device") < tab.text("main").index("The robot")


def test_without_a_headset_it_says_so(desk, chromium):
    with opened(chromium, f"{desk.url}/#{TOKEN}") as tab:
        says(tab, "finds no headset", "#checks")
        says(tab, "Pass-through is not there", "#checks")


def test_a_page_that_is_not_trusted_says_what_to_install(desk, chromium):
    # Browsers do not count this address among those of the machine itself, though it leads there.
    with opened(chromium, desk.url.replace("127.0.0.1", "0.0.0.0") + f"/#{TOKEN}") as tab:
        assert not tab.js("isSecureContext")
        says(tab, "The browser does not trust this page", "#checks")
        assert tab.js(f"document.querySelector('{ENTER}').disabled")


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ("Promise.reject(new DOMException('policy', 'SecurityError'))", "The browser forbids virtual reality here"),
        ("Promise.reject(new Error('odd'))", "finds no headset"),
    ],
)
def test_a_browser_that_refuses_to_say_what_it_has(desk, chromium, answer, words):
    with opened(chromium, f"{desk.url}/#{TOKEN}", f"XRSystem.prototype.isSessionSupported = () => {answer}") as tab:
        says(tab, words, "#checks")


@pytest.mark.parametrize(
    ("error", "words"),
    [
        ("new DOMException('x', 'NotAllowedError')", "say yes when the headset asks"),
        ("new DOMException('x', 'NotSupportedError')", "does not offer this mode"),
        ("new DOMException('x', 'SecurityError')", "only from a press of the button"),
        ("new DOMException('x', 'InvalidStateError')", "another virtual reality session is running"),
        ("new Error('the sky fell')", "the sky fell. Reload this page"),
    ],
)
def test_a_headset_that_lets_nobody_in_says_why(worn, error, words):
    ready(worn)
    worn.js(f"() => {{ navigator.xr.requestSession = async () => {{ throw {error}; }}; }}")
    worn.click(ENTER)
    says(worn, words, "#fault")
    worn.js("delete navigator.xr.requestSession")
    ready(worn)


def test_what_nobody_catches_is_shown(worn):
    worn.js("Promise.reject(new Error('a lost promise')); 0")
    says(worn, "a lost promise. Reload it", "#fault")
    worn.js("setTimeout(() => { throw new Error('a lost error') }); 0")
    says(worn, "a lost error. Reload it", "#fault")


def test_entering_sends_packets_that_count_and_leaving_says_that_nobody_is_there(rig, worn):
    ready(worn)
    worn.click(ENTER)
    first = rig.packet(lambda packet: packet.left.pose is not None and packet.right.pose is not None)
    later = rig.packet(lambda packet: packet.seq > first.seq + 5)
    assert first.visible
    assert first.head is not None
    assert first.epoch == later.epoch >= 1
    assert later.capture_ms > first.capture_ms
    assert rig.pose.refused == 0
    assert rig.pose.device == "X11; Linux x86_64; Quest 3, OculusBrowser 33"
    stats = worn.js("ikxr.stats")
    assert stats["sent"] + stats["dropped"] >= later.seq
    assert stats["dropped"] == 0
    worn.js("xrDevice.activeSession.end()")
    last = rig.packet(lambda packet: not packet.visible)
    assert (last.head, last.left.pose, last.right.pose) == (None, None, None)
    ready(worn)
    assert rig.packets[-1] is last
    says(worn, "VR shows the robot", "#enter-why")


def test_without_a_press_of_the_button_where_the_headset_lets_one_in(rig, worn):
    ready(worn)
    worn.js("navigator.xr.dispatchEvent(new Event('sessiongranted')); 0")
    rig.packet(lambda packet: packet.visible)
    worn.js("xrDevice.activeSession.end()")
    ready(worn)


def test_surroundings_are_seen_in_ar(rig, worn):
    ready(worn)
    worn.click("#enter-ar")
    rig.packet(lambda packet: packet.visible)
    assert worn.js("ikxr.session.environmentBlendMode") != "opaque"
    worn.js("xrDevice.activeSession.end()")
    ready(worn)


def test_graphics_that_are_lost_end_the_session_in_words(desk, chromium):
    with opened(chromium, f"{desk.url}/emulate#{TOKEN}") as tab:
        ready(tab)
        tab.click(ENTER)
        desk.packet(lambda packet: packet.visible)
        tab.js("document.querySelector('#view').getContext('webgl2').getExtension('WEBGL_lose_context').loseContext()")
        desk.packet(lambda packet: not packet.visible)
        says(tab, "The headset took the graphics away", "#fault")
        assert tab.js("ikxr.session") is None


def test_the_robots_state_is_read_outside_vr_and_a_fault_is_cleared(rig, worn):
    rig.hud = FAULTY
    says(worn, "left arm: fault", "#state-left")
    says(worn, "the robot does not follow", "#state-left")
    says(worn, "right arm: active", "#state-right")
    says(worn, "3 mm from target", "#state-right")
    says(worn, "11 ms", "#latency")
    worn.click("#clear-fault")
    assert rig.cleared.wait(10.0)
    rig.hud = Hud()
    says(worn, "left arm: disarmed", "#state-left")
    holds(worn, "document.querySelector('#clear-fault').hidden")


def test_the_view_is_remembered(desk, chromium):
    with opened(chromium, f"{desk.url}/emulate#{TOKEN}") as tab:
        assert tab.js("document.querySelector('#view-mode').value") == "screen"
        tab.js("""const select = document.querySelector("#view-mode");
                  select.value = "head"; select.dispatchEvent(new Event("change")); 0""")
        tab.reload()
        assert tab.js("document.querySelector('#view-mode').value") == "head"


def test_a_server_that_goes_is_missed_and_found_again(chromium, iwer):
    rig = Rig()
    port = rig.start()
    with opened(chromium, f"{rig.url}/emulate#{TOKEN}", PAUSES) as tab:
        says(tab, "connected to ik-xr", "#connection")
        rig.stop()
        says(tab, "ik-xr does not answer: is it running", "#connection")
        says(tab, "trying again", "#connection")
        assert FIRST_PAUSE in tab.js("pauses")
        assert tab.js(f"document.querySelector('{ENTER}').disabled")
        again = Rig("another token")
        again.start(port)
        says(tab, "wrong token: ik-xr was started anew", "#connection")
        again.stop()


def test_a_server_that_falls_silent_is_given_up_and_tried_again(chromium, iwer):
    rig = Rig()
    rig.start()
    with opened(chromium, f"{rig.url}/emulate#{TOKEN}", HURRY) as tab:
        says(tab, "connected to ik-xr", "#connection")
        rig.speaks.clear()
        tab.js("globalThis.skipped = 5000")
        says(tab, "ik-xr says nothing any more", "#connection")
        rig.speaks.set()
        says(tab, "connected to ik-xr", "#connection")
    rig.stop()


def test_who_was_taken_over_comes_back_when_told_to(desk, chromium):
    with opened(chromium, f"{desk.url}/emulate#{TOKEN}") as first:
        ready(first)
        with opened(chromium, f"{desk.url}/emulate#{TOKEN}") as second:
            says(first, "another headset has taken over", "#connection")
            ready(second)
            first.click("#connect")
            ready(first)
            says(second, "another headset has taken over", "#connection")
