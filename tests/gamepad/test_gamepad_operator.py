"""From sticks and keys to a wish: layout, dead zone, frames, paces; with SDL's own virtual pad."""

import numpy as np
import pytest

pygame = pytest.importorskip("pygame")
from virtual_pad import VirtualPad  # noqa: E402

from gamepad_client.layout import Layout  # noqa: E402
from gamepad_client.operator import PACES, Operator  # noqa: E402
from gamepad_client.shaping import Shaping  # noqa: E402
from ik_client.devices import DeviceError, Devices  # noqa: E402
from ik_client.start import SettingsError  # noqa: E402

SPEED, TURN = 0.3, 0.8


class Hands:
    """An operator, and the pad in its hands."""

    def __init__(self, devices: Devices) -> None:
        self.pad = VirtualPad()
        self.operator = Operator(devices, Layout(), shaping=Shaping(0.1, 1.0))
        self.now = 0.0

    def wish(self):
        self.now += 0.005
        return self.operator.wish(self.now)

    def press(self, name: str) -> None:
        self.pad.button(name, True)
        self.wish()
        self.pad.button(name, False)
        self.wish()


@pytest.fixture
def hands():
    with Devices() as devices:
        hands = Hands(devices)
        hands.wish()
        yield hands
        hands.pad.unplug()


@pytest.fixture
def keys(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with Devices((100, 100)) as devices:
        yield Operator(devices, Layout(), keyboard=True)


def key(name: str, down: bool = True) -> None:
    kind = pygame.KEYDOWN if down else pygame.KEYUP
    pygame.event.post(pygame.event.Event(kind, key=pygame.key.key_code(name)))


@pytest.mark.parametrize(
    ("axis", "value", "side", "direction"),
    [
        ("left_stick_y", -1.0, 0, (1, 0, 0)),
        ("left_stick_y", 1.0, 0, (-1, 0, 0)),
        ("left_stick_x", -1.0, 0, (0, 1, 0)),
        ("left_stick_x", 1.0, 0, (0, -1, 0)),
        ("right_stick_y", -1.0, 1, (1, 0, 0)),
        ("right_stick_x", -1.0, 1, (0, 1, 0)),
    ],
)
def test_a_stick_moves_its_hand_as_the_document_has_it(hands, axis, value, side, direction):
    """`cart_vel = [axes[1], -axes[0], ...]`: forward is x, to the left is y."""
    hands.pad.axis(axis, value)
    wish = hands.wish()
    wanted = np.zeros((2, 6))
    wanted[side, :3] = np.multiply(SPEED, direction)
    np.testing.assert_allclose(wish.twists, wanted, atol=1e-3)


@pytest.mark.parametrize(
    ("control", "up"), [("dpad_up", 1), ("dpad_down", -1), ("right_trigger", 1), ("left_trigger", -1)]
)
def test_both_hands_go_up_and_down(hands, control, up):
    (hands.pad.axis if "trigger" in control else hands.pad.button)(control, 1)
    np.testing.assert_allclose(hands.wish().twists[:, 2], [SPEED * up] * 2, atol=1e-3)


def test_a_trigger_is_pulled_by_degrees(hands):
    hands.pad.axis("right_trigger", 0.55)
    assert hands.wish().twists[0, 2] == pytest.approx(SPEED * 0.5, abs=1e-2)


def test_one_hand_alone_goes_up_with_lift(hands):
    hands.pad.button("south", True)
    hands.pad.axis("left_stick_y", -1.0)
    np.testing.assert_allclose(hands.wish().twists[:, :3], [[0, 0, SPEED], [0, 0, 0]], atol=1e-3)


def test_with_turn_the_same_controls_turn(hands):
    hands.pad.button("right_shoulder", True)
    for axis, about in (("left_stick_y", 1), ("left_stick_x", 2)):
        hands.pad.axis(axis, -1.0)
        twists = hands.wish().twists
        assert not twists[:, :3].any()
        assert twists[0, 3 + about] == pytest.approx(TURN, abs=1e-3)
        hands.pad.axis(axis, 0.0)
    hands.pad.button("dpad_up", True)
    np.testing.assert_allclose(hands.wish().twists[:, 3:], [[TURN, 0, 0]] * 2, atol=1e-3)


def test_no_direction_is_faster_than_another(hands):
    hands.pad.axis("left_stick_y", -0.8)
    hands.pad.axis("left_stick_x", -0.8)
    hands.pad.button("dpad_up", True)
    assert np.linalg.norm(hands.wish().twists[0]) == pytest.approx(SPEED, rel=1e-6)


def test_the_axes_change_with_each_press(hands):
    frames = []
    for _ in range(3):
        frames.append(hands.operator.frame)
        hands.press("north")
    assert frames == ["pelvis", "hand", "pelvis"]
    assert hands.wish().frame == "hand"


def test_paces_go_up_and_down_between_their_ends(hands):
    assert hands.operator.speed == pytest.approx(SPEED)
    hands.press("dpad_right")
    assert 1.2 < hands.operator.pace < 1.3
    hands.pad.axis("left_stick_y", -1.0)
    assert hands.wish().twists[0, 0] == pytest.approx(SPEED * hands.operator.pace, rel=1e-2)
    for _ in range(30):
        hands.press("dpad_left")
    assert hands.operator.speed == pytest.approx(SPEED * 0.1, rel=0.3)
    for _ in range(30):
        hands.press("dpad_right")
    assert hands.operator.speed == pytest.approx(SPEED * 2.0, rel=0.3)
    assert len(PACES) < 30


def test_home_and_stop_are_wanted_while_they_are_held(hands):
    for button, name in (("west", "home"), ("east", "stop")):
        hands.pad.button(button, True)
        assert (getattr(hands.wish(), name), getattr(hands.wish(), name)) == (True, True)
        hands.pad.button(button, False)
        assert not getattr(hands.wish(), name)


def test_unplugged_nothing_is_wanted_and_the_switch_is_gone(hands):
    hands.pad.button("left_shoulder", True)
    hands.pad.axis("left_stick_y", -1.0)
    wish = hands.wish()
    assert wish.held is True
    assert wish.twists.any()
    hands.pad.unplug()
    wish = hands.wish()
    assert wish.held is None
    assert not wish.twists.any()
    hands.pad.plug()
    hands.pad.button("left_shoulder", True)
    hands.wish()
    assert hands.wish().held is True  # whether that counts is the loop's business: see `HoldToRun`


def test_another_pad_is_taken_up_after_a_tick_without_one(hands):
    other = VirtualPad()
    hands.wish()
    other.button("left_shoulder", True)
    hands.pad.button("left_shoulder", True)
    assert hands.wish().held is True
    hands.pad.unplug()
    assert hands.wish().held is None
    hands.wish()
    assert hands.wish().held is True
    other.unplug()
    hands.pad.plug()


def test_keys_move_hands_one_by_one(keys):
    for name, side, direction in (
        ("w", 0, (1, 0, 0)),
        ("d", 0, (0, -1, 0)),
        ("r", 0, (0, 0, 1)),
        ("k", 1, (-1, 0, 0)),
        ("j", 1, (0, 1, 0)),
        ("h", 1, (0, 0, -1)),
    ):
        key(name)
        wanted = np.zeros((2, 6))
        wanted[side, :3] = np.multiply(SPEED, direction)
        np.testing.assert_allclose(keys.wish(0.0).twists, wanted, atol=1e-12)
        key(name, down=False)
    assert keys.wish(0.0).held is False
    key("space")
    assert keys.wish(0.0).held is True


def test_keys_that_cancel_out_move_nothing(keys):
    key("w")
    key("s")
    assert not keys.wish(0.0).twists.any()


def test_a_short_press_of_a_key_counts(keys):
    key("tab")
    key("tab", down=False)
    assert keys.wish(0.0).frame == "hand"


def test_escape_and_a_closed_window_end_it(keys):
    keys.wish(0.0)
    assert not keys.ended
    key("escape")
    keys.wish(0.0)
    assert keys.ended


def test_what_cannot_be_a_switch_or_a_key_is_refused(keys, monkeypatch):
    with pytest.raises(DeviceError, match="no switch"):
        Operator(keys._devices, Layout(hold="elsewhere"))
    with pytest.raises(SettingsError, match="there is no key 'spacebar'"):
        Operator(keys._devices, Layout(keys=Layout().keys | {"home": "spacebar"}), keyboard=True)
