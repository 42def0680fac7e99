"""Devices: pads through SDL's own virtual one, keys of a window, pedals; and switches made of them."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pygame = pytest.importorskip("pygame")
from virtual_pad import VirtualPad  # noqa: E402

from ik_client.devices import AXES, BUTTONS, DeviceError, Devices, open_switch  # noqa: E402


@pytest.fixture
def devices():
    with Devices() as devices:
        yield devices


@pytest.fixture
def windowed(monkeypatch):
    """With a window, that of a display nobody sees."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with Devices((320, 200), "test") as devices:
        devices.pump()
        yield devices


def post(kind: str, **fields) -> None:
    pygame.event.post(pygame.event.Event(getattr(pygame, kind), fields))


def test_a_pad_comes_moves_and_goes(devices):
    assert devices.pads == ()
    virtual = VirtualPad()
    devices.pump()
    (pad,) = devices.pads
    assert pad.connected
    assert pad.name
    virtual.axis("left_stick_x", -1.0)
    virtual.axis("right_stick_y", 0.5)
    virtual.axis("right_trigger", 1.0)
    virtual.button("south", True)
    devices.pump()
    assert pad.axis("left_stick_x") == pytest.approx(-1.0, abs=1e-3)
    assert pad.axis("right_stick_y") == pytest.approx(0.5, abs=1e-3)
    assert [pad.axis(name) for name in ("left_trigger", "right_trigger")] == pytest.approx([0.0, 1.0], abs=1e-3)
    # What is printed there, on one make or the other, is the same button.
    assert [pad.button(name) for name in ("south", "a", "cross", "r2", "east")] == [True, True, True, True, False]
    virtual.unplug()
    devices.pump()
    assert devices.pads == ()
    assert not pad.connected
    assert not any(pad.button(name) for name in BUTTONS)
    assert not any(pad.axis(name) for name in AXES)


def test_every_control_is_the_one_of_its_name(devices):
    virtual = VirtualPad()
    devices.pump()
    (pad,) = devices.pads
    for name in BUTTONS:
        virtual.button(name, True)
        devices.pump()
        assert [other for other in BUTTONS if pad.button(other)] == [name]
        virtual.button(name, False)
    virtual.rest()
    for name in AXES:
        virtual.axis(name, 1.0)
        devices.pump()
        assert [other for other in AXES if pad.axis(other) > 0.5] == [name]
        virtual.axis(name, 0.0)
    virtual.unplug()
    devices.pump()


def test_pads_stand_in_the_order_in_which_they_came(devices):
    first, second = VirtualPad(), VirtualPad()
    devices.pump()
    one, other = devices.pads
    first.unplug()
    devices.pump()
    assert devices.pads == (other,)
    first.plug()
    devices.pump()
    assert devices.pads[0] is other
    assert len({one.id, *(pad.id for pad in devices.pads)}) == 3
    second.unplug()
    first.unplug()
    devices.pump()


def test_a_pad_that_was_there_before_is_found():
    with Devices() as before:
        virtual = VirtualPad()
        before.pump()
        assert len(before.pads) == 1
        virtual.unplug()


def test_keys_are_held_until_they_are_let_go(windowed):
    post("KEYDOWN", key=pygame.K_SPACE)
    post("KEYDOWN", key=pygame.K_w)
    windowed.pump()
    assert windowed.keys == windowed.pressed == {"space", "w"}
    windowed.pump()
    assert windowed.keys == {"space", "w"}
    assert windowed.pressed == frozenset()
    post("KEYUP", key=pygame.K_w)
    windowed.pump()
    assert windowed.keys == {"space"}


def test_a_key_that_went_down_and_up_between_two_looks_was_pressed(windowed):
    post("KEYDOWN", key=pygame.K_h)
    post("KEYUP", key=pygame.K_h)
    windowed.pump()
    assert (windowed.pressed, windowed.keys) == ({"h"}, frozenset())


@pytest.mark.parametrize("event", ["WINDOWFOCUSLOST", "WINDOWMINIMIZED", "WINDOWHIDDEN", "QUIT"])
def test_who_turns_to_another_window_lets_go_of_all_keys(windowed, event):
    post("KEYDOWN", key=pygame.K_SPACE)
    windowed.pump()
    post(event)
    windowed.pump()
    assert windowed.keys == frozenset()
    assert windowed.closed == (event == "QUIT")


def test_a_picture_is_shown_in_a_window_of_any_size(windowed):
    windowed.show(np.full((100, 160, 3), (10, 200, 30), dtype=np.uint8))
    assert tuple(pygame.display.get_surface().get_at((160, 100)))[:3] == (10, 200, 30)


def test_a_picture_goes_nowhere_without_a_window(devices):
    devices.show(np.zeros((10, 10, 3), dtype=np.uint8))


def test_without_a_display_a_window_is_refused_in_one_line(monkeypatch):
    for name in ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("SDL_VIDEODRIVER", "x11")
    with pytest.raises(DeviceError, match="no display for a window") as refused:
        Devices((100, 100))
    assert "\n" not in str(refused.value)
    Devices().close()  # and pads work as before


def test_mappings_make_any_pad_a_known_one(tmp_path: Path):
    """A pad whose buttons south and east are exchanged, told by a file."""
    code = f"""
import sys; sys.path[:0] = {[str(Path(__file__).parents[1])]!r}
from pathlib import Path
from virtual_pad import VirtualPad
from ik_client.devices import Devices
with Devices() as devices:
    virtual = VirtualPad(); devices.pump()
    guid = devices.pads[0]._joystick.get_guid(); virtual.unplug()
guid = guid[:4] + "0000" + guid[8:]  # without its checksum, as in the database
file = Path({str(tmp_path / "pads.txt")!r})
file.write_text(f"# ours\\n{{guid}},Strange Pad,a:b1,b:b0,leftx:a0,\\n")
with Devices(mappings=file) as devices:
    virtual = VirtualPad(); devices.pump()
    virtual.button("south", True); devices.pump()
    (pad,) = devices.pads
    print(pad.name, pad.button("east"), pad.button("south"))
"""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert told.stdout.strip() == "Strange Pad True False", told.stderr


@pytest.mark.parametrize("text", ["nonsense", "0300,Pad", "0300,Pad,a b0"])
def test_what_is_no_mapping_gets_one_line(tmp_path: Path, text):
    file = tmp_path / "pads.txt"
    file.write_text(text)
    with pytest.raises(DeviceError, match=r"is no mapping; a line is GUID,NAME,a:b0"):
        Devices(mappings=file)
    with pytest.raises(DeviceError, match="cannot be read"):
        Devices(mappings=tmp_path / "none")


def test_a_key_is_a_switch(windowed):
    switch = open_switch("key:space", windowed)
    assert switch.held is False
    post("KEYDOWN", key=pygame.K_SPACE)
    windowed.pump()
    assert switch.held is True
    post("WINDOWFOCUSLOST")
    windowed.pump()
    assert switch.held is False
    post("QUIT")
    windowed.pump()
    assert switch.held is None


def test_a_button_is_a_switch_of_one_pad_at_a_time(devices):
    switch = open_switch("pad:l1", devices)
    assert switch.held is None
    first, second = VirtualPad(), VirtualPad()
    devices.pump()
    assert switch.held is False
    first.button("left_shoulder", True)
    second.button("left_shoulder", True)
    devices.pump()
    assert switch.held is True
    first.unplug()
    devices.pump()
    # The other one's button is held too, but nobody has pressed it for this: first the switch is gone.
    assert (switch.held, switch.held) == (None, None)
    devices.pump()
    assert switch.held is True
    second.unplug()
    devices.pump()
    assert switch.held is None


def test_a_trigger_is_a_switch(devices):
    virtual, switch = VirtualPad(), open_switch("pad:right_trigger", devices)
    for pull, held in ((0.0, False), (0.4, False), (0.6, True), (1.0, True)):
        virtual.axis("right_trigger", pull)
        devices.pump()
        assert switch.held is held
    virtual.unplug()


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("", "write key:NAME as in key:space, pad:BUTTON"),
        ("space", "write key:NAME as in key:space, pad:BUTTON"),
        ("mouse:left", "write key:NAME as in key:space, pad:BUTTON"),
        ("key:", "write key:NAME"),
        ("pad:paddle", "a pad has no button 'paddle': choose one of south, east"),
        ("pad:left_stick_x", "a pad has no button 'left_stick_x'"),
        ("pedal:/dev/input/none", "pedal /dev/input/none: No such file or directory; input devices here:"),
        ("pedal:/dev/null", "pedal /dev/null: "),
        ("key:space", "needs a window of ours"),
    ],
)
def test_a_switch_that_is_none_gets_one_line(devices, spec, words):
    with pytest.raises(DeviceError) as refused:
        open_switch(spec, devices)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_key_that_no_keyboard_has_gets_one_line(windowed):
    with pytest.raises(DeviceError, match="there is no key 'spacebar'"):
        open_switch("key:spacebar", windowed)


class FakeEvdev:
    """One input device at one path, with what the kernel would say of it."""

    EV_SYN, EV_KEY, CODE = 0, 1, 48

    def __init__(self) -> None:
        self.name, self.info, self.there = "pedal", (1, 2), True
        self.held: list[int] = []
        self.events: list[tuple[int, int, int]] = []

    def open(self, path):
        if not self.there:
            raise FileNotFoundError(2, "No such file or directory")
        return _Opened(self)


class _Opened:
    def __init__(self, fake: FakeEvdev) -> None:
        self.fake, self.name, self.info = fake, fake.name, fake.info

    def capabilities(self):
        return {FakeEvdev.EV_KEY: [FakeEvdev.CODE]}

    def active_keys(self):
        return list(self.fake.held)

    def read(self):
        import types

        if not self.fake.there:
            raise OSError(19, "No such device")
        if not self.fake.events:
            raise BlockingIOError
        events, self.fake.events = self.fake.events, []
        return iter(types.SimpleNamespace(type=t, code=c, value=v) for t, c, v in events)

    def close(self):
        pass


@pytest.fixture
def fake_evdev(monkeypatch):
    evdev = pytest.importorskip("evdev")
    fake = FakeEvdev()
    monkeypatch.setattr(evdev, "InputDevice", fake.open)
    return fake


def test_a_pedal_is_read_lost_and_found_again(fake_evdev, devices, monkeypatch):
    from ik_client.devices.pedal import Pedal

    now = [0.0]
    fake, pedal = fake_evdev, Pedal("/dev/input/event5", clock=lambda: now[0])
    assert pedal.held is False
    fake.events = [(fake.EV_KEY, fake.CODE, 1), (fake.EV_SYN, 0, 0)]
    assert pedal.held is True
    fake.events = [(fake.EV_KEY, fake.CODE, 2)]  # it repeats
    assert pedal.held is True
    fake.events = [(fake.EV_KEY, fake.CODE, 0)]
    assert pedal.held is False
    fake.events, fake.held = [(fake.EV_SYN, 3, 0)], [fake.CODE]  # events were lost: what is held is asked anew
    assert pedal.held is True
    fake.there = False
    assert pedal.held is None
    fake.there, now[0] = True, 0.1
    assert pedal.held is True  # found at the first look
    fake.there = False
    assert pedal.held is None
    fake.there, fake.info, now[0] = True, (9, 9), 1.0
    assert pedal.held is None  # another device at its place is not it
    fake.info, now[0] = (1, 2), 1.2
    assert pedal.held is None  # too early for the next look
    now[0] = 2.0
    assert pedal.held is True


def test_a_real_pedal():
    """The kernel's own device, where the machine lets us make one."""
    evdev = pytest.importorskip("evdev")
    try:
        made = evdev.UInput({evdev.ecodes.EV_KEY: [evdev.ecodes.KEY_B]}, name="pedal of a test")
    except (evdev.UInputError, OSError) as error:
        pytest.skip(f"no /dev/uinput to make a pedal with: {error}")
    from ik_client.devices.pedal import Pedal

    with made:
        pedal = Pedal(made.device.path)
        assert pedal.held is False
        made.write(evdev.ecodes.EV_KEY, evdev.ecodes.KEY_B, 1)
        made.syn()
        assert pedal.held is True
    assert pedal.held is None
    pedal.close()


def test_importing_devices_loads_neither_sdl_nor_evdev():
    code = "import sys, ik_client.devices; print(sorted({'pygame', 'evdev'} & set(sys.modules)))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_however_pads_come_and_go_those_that_are_there_are_known(devices):
    rng = np.random.default_rng(1)
    live: list[VirtualPad] = []
    for _ in range(200):
        if rng.random() < 0.5 and len(live) < 5:
            live.append(VirtualPad())
        elif live:
            live.pop(rng.integers(len(live))).unplug()
        if rng.random() < 0.6:
            devices.pump()
            assert len(devices.pads) == len(live)
    for virtual in live:
        virtual.unplug()
