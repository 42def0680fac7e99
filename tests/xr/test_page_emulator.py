"""`/emulate`: the page with an emulated headset, moved by mouse and keys as a person would."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from xr_browser import browse
from xr_page import PageServer, wait_for

from xr_client.packets import Kind

LEFT, RIGHT = "left", "right"


def positions(worn) -> dict[str, np.ndarray]:
    """Where head and hands are [m], in WebXR's axes."""
    server, tab = worn
    packet = server.after(tab).packet
    assert packet.head is not None
    assert packet.left.pose is not None
    assert packet.right.pose is not None
    return {"head": packet.head[:3], LEFT: packet.left.pose[:3], RIGHT: packet.right.pose[:3]}


def near(a: Any, b: Any, tolerance: float = 1e-5) -> bool:
    return bool(np.linalg.norm(np.subtract(a, b)) < tolerance)


def answer(url: str) -> tuple[int, str, str]:
    """Status, policy and text."""

    async def work(http: Any) -> tuple[int, str, str]:
        async with http.get(url) as response:
            return response.status, response.headers["Content-Security-Policy"], await response.text()

    return browse(work)


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "web" / "emulator").mkdir(parents=True)
    (tmp_path / "web" / "emulator" / "main.js").write_text("1;")
    (tmp_path / "web" / "index.html").write_text('<!doctype html><title>é</title><script src="main.js"></script>end')
    (tmp_path / "iwer.js").write_text("globalThis.IWER = 1;")
    return tmp_path / "web"


def test_its_scripts_come_before_the_pages_own(folder):
    server = PageServer(folder=folder, emulator=folder.parent / "iwer.js")
    server.start()
    status, policy, text = answer(server.url + "/emulate")
    _, plain_policy, plain = answer(server.url + "/")
    scripts = [text.index(name) for name in ("emulator/iwer.js", "emulator/main.js", 'src="main.js"')]
    assert (status, scripts) == (200, sorted(scripts))
    assert policy == plain_policy
    assert "emulator" not in plain
    assert "é" in text
    assert text.endswith("end")
    assert answer(server.url + "/emulator/iwer.js")[2] == "globalThis.IWER = 1;"
    assert answer(server.url + "/emulator/main.js")[2] == "1;"
    (folder / "index.html").unlink()
    assert answer(server.url + "/emulate")[0] == 404
    server.stop()


def test_it_is_not_there_unless_it_was_asked_for(folder):
    server = PageServer(folder=folder)
    server.start()
    for path in ("/emulate", "/emulator/iwer.js", "/emulator/main.js", "/x/../emulator/main.js", "/emulator/"):
        assert answer(server.url + path)[0] == 404, path
    assert answer(server.url + "/")[0] == 200
    server.stop()


def test_a_person_is_told_the_keys(worn):
    _, tab = worn
    told = tab.text("#emulator-help")
    assert all(word in told for word in ("space", "grip", "drag", "W A S D", "recenter", "moving: both hands"))
    tab.key("Slash")
    tab.until("!document.querySelector('#emulator-help').innerText.includes('W A S D')")
    tab.key("Slash")
    tab.until("document.querySelector('#emulator-help').innerText.includes('W A S D')")
    # The panel lies over the view, but a click goes through.
    beneath = """(() => {
      const { x, y } = document.querySelector("#emulator-help").getBoundingClientRect();
      return document.elementFromPoint(x + 20, y + 20).closest("#emulator-help");
    })()"""
    assert tab.js(beneath) is None


def test_hands_tremble_so_that_they_are_not_taken_for_frozen_ones(worn):
    server, tab = worn
    seen = []
    for _ in range(10):
        arrival = server.after(tab)
        assert arrival.packet.left.pose is not None
        seen.append(arrival.packet.left.pose[:3])
    assert len({position.tobytes() for position in seen}) == len(seen)
    assert all(near(position, [-0.2, 1.25, -0.4]) for position in seen)


def test_keys_move_the_chosen_hand_for_as_long_as_they_are_held(worn):
    _, tab = worn
    tab.key("Digit1")
    with tab.holding("ArrowRight"):
        wait_for(lambda: positions(worn)[LEFT][0] > -0.1, "the hand moves")
    moved = positions(worn)
    assert near(moved[LEFT][1:], [1.25, -0.4])
    assert near(moved[RIGHT], [0.2, 1.25, -0.4])
    assert near(positions(worn)[LEFT], moved[LEFT])
    tab.key("Digit2")
    with tab.holding("PageUp"):
        wait_for(lambda: positions(worn)[RIGHT][2] < -0.45, "the hand goes away from the head")
    assert near(positions(worn)[LEFT], moved[LEFT])


def test_the_mouse_moves_hands_and_turns_the_head(worn):
    server, tab = worn
    tab.drag((300, 300), (400, 250))
    moved = positions(worn)
    assert near(moved[LEFT], [-0.1, 1.3, -0.4])
    assert near(moved[RIGHT], [0.3, 1.3, -0.4])
    tab.roll(-200)
    wait_for(lambda: near(positions(worn)[LEFT], [-0.1, 1.3, -0.5]), "the hands went away by 10 cm")
    tab.drag((300, 300), (200, 300), button="right")
    looked = server.after(tab).packet
    assert looked.head is not None
    # A drag to the left turns the head to the right or left by 0.3 rad; the hands stay.
    assert 2.0 * np.arcsin(abs(looked.head[4])) == pytest.approx(0.3, abs=1e-5)
    assert near(positions(worn)[LEFT], [-0.1, 1.3, -0.5])


def test_shift_and_drag_turn_a_hand_where_it_is(worn):
    server, tab = worn
    with tab.holding("ShiftLeft"):
        tab.drag((300, 300), (350, 300))
    pose = server.after(tab).packet.left.pose
    assert pose is not None
    assert near(pose[:3], [-0.2, 1.25, -0.4])
    assert 2.0 * np.arcsin(np.linalg.norm(pose[3:6])) == pytest.approx(0.3, abs=1e-5)


def test_walking_takes_the_hands_along(worn):
    _, tab = worn
    before = positions(worn)
    with tab.holding("KeyW"):
        wait_for(lambda: positions(worn)["head"][2] < -0.1, "the head moves")
    after = positions(worn)
    for part in (LEFT, RIGHT):
        assert near(after[part] - before[part], after["head"] - before["head"])


def test_the_space_bar_grips_while_it_is_held(worn):
    server, tab = worn
    tab.key("Digit2")
    with tab.holding("Space"):
        closed = server.arrival(lambda latest: (latest.packet.right.pinch or 1.0) < 0.01, "a pinch").packet
        assert closed.left.pinch is not None
        assert closed.left.pinch > 0.08
    server.arrival(lambda latest: (latest.packet.right.pinch or 0.0) > 0.08, "an open hand")


def test_a_window_that_loses_the_keyboard_lets_go(worn):
    server, tab = worn
    with tab.holding("Space"):
        server.arrival(lambda latest: (latest.packet.right.pinch or 1.0) < 0.01, "a pinch")
        tab.js("dispatchEvent(new Event('blur')); 0")
        server.arrival(lambda latest: (latest.packet.right.pinch or 0.0) > 0.08, "an open hand")


def test_keys_for_what_happens_to_a_headset(worn):
    server, tab = worn
    tab.key("KeyH")
    held = server.arrival(lambda latest: latest.packet.left.kind is Kind.CONTROLLER, "controllers").packet
    with tab.holding("Space"):
        server.arrival(lambda latest: latest.packet.left.squeeze == 1.0, "a squeeze")
    tab.key("KeyH")
    server.arrival(lambda latest: latest.packet.left.kind is Kind.HAND, "hands")
    tab.key("Digit1")
    tab.key("KeyL")
    server.arrival(lambda latest: latest.packet.left.pose is None and latest.packet.right.pose is not None, "one hand")
    tab.key("KeyL")
    server.arrival(lambda latest: latest.packet.left.pose is not None, "both hands")
    tab.key("KeyR")
    moved = server.arrival(lambda latest: latest.packet.epoch > held.epoch, "another room").packet
    tab.key("KeyM")
    server.arrival(lambda latest: not latest.packet.visible, "a menu")
    tab.until("document.querySelector('#emulator-help').innerText.includes('a menu is open')")
    tab.key("KeyM")
    server.arrival(lambda latest: latest.packet.visible and latest.packet.epoch > moved.epoch, "no menu")
    tab.key("Escape")
    tab.until("!xrDevice.activeSession && document.querySelector('#enter-vr').disabled === false")
    tab.click("#enter-vr")
    server.after(tab)
