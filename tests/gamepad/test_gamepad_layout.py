"""Mapping files and settings: what is read, and what gets one line."""

from pathlib import Path

import numpy as np
import pytest

from gamepad_client.layout import BUTTONS, KEYS, STICKS, Layout, read_layout
from gamepad_client.settings import DOCUMENT_BOUNDS, Settings
from ik_client.devices.pad import axis_name, button_name
from ik_client.start import SettingsError
from ik_proto import InfoReply, Status


def write(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "mapping.toml"
    file.write_text(text)
    return file


def test_the_default_names_controls_that_pads_have():
    for axis in STICKS.values():
        axis_name(axis.removeprefix("-"))
    for names in BUTTONS.values():
        for name in names:
            button_name(name)


def test_an_empty_file_is_the_default(tmp_path):
    assert read_layout(write(tmp_path, "")) == Layout()


def test_what_a_file_says_is_taken_and_the_rest_is_left(tmp_path):
    layout = read_layout(
        write(
            tmp_path,
            """
            hold = "pedal:/dev/input/event5"
            [sticks]
            left_forward = "right_trigger"
            [buttons]
            home = "start"
            up = ["north", "l3"]
            frame = []
            down = "dpad_down"
            [keys]
            home = "b"
            """,
        )
    )
    assert layout.hold == "pedal:/dev/input/event5"
    assert layout.sticks == STICKS | {"left_forward": "right_trigger"}
    changed = {"home": ("start",), "up": ("north", "left_stick"), "frame": (), "down": ("dpad_down",)}
    assert layout.buttons == BUTTONS | changed
    assert layout.keys == KEYS | {"home": "b"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hold", "is no mapping file in TOML"),
        ("speed = 1", "a mapping file has no 'speed': choose of hold, sticks, buttons, keys"),
        ("hold = 3", "hold must be a switch in quotes"),
        ("sticks = 3", "sticks must be a table: [sticks]"),
        ("[sticks]\nup = 'left_stick_y'", "[sticks] has no 'up'"),
        ("[sticks]\nleft_left = 'wheel'", "[sticks] left_left: a pad has no axis 'wheel'"),
        ("[sticks]\nleft_left = 1", "[sticks] left_left: write the name of an axis in quotes"),
        ("[buttons]\nfire = 'south'", "[buttons] has no 'fire'"),
        ("[buttons]\nhome = 'paddle'", "[buttons] home: a pad has no button 'paddle'"),
        ("[buttons]\nhome = 7", "[buttons] home: write the name of a button"),
        ("[buttons]\nhome = 'l1'", "button 'left_shoulder' is to do both 'hold' and 'home'"),
        ("[buttons]\nhome = 'circle'", "button 'east' is to do both 'home' and 'stop'"),
        ("[keys]\nhome = 1", "[keys] home: write the name of a key in quotes"),
        ("[keys]\nhome = 'space'", "key 'space' is to do both 'hold' and 'home'"),
        ("[keys]\nhome = 'w'", "key 'w' is to do both"),
    ],
)
def test_what_is_no_mapping_gets_one_line(tmp_path, text, words):
    with pytest.raises(SettingsError) as refused:
        read_layout(write(tmp_path, text))
    assert words in " ".join(str(refused.value).split())
    assert "mapping.toml" in str(refused.value)


def test_a_file_that_is_not_there_gets_one_line(tmp_path):
    with pytest.raises(SettingsError, match="cannot be read: No such file"):
        read_layout(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rate": 20.0}, "--rate 20: must be from 50 to 400"),
        ({"speed": float("nan")}, "--speed nan: must be from"),
        ({"dead_zone": 1.0}, "--dead-zone 1: must be from 0 to 0.9"),
        ({"curve": 0.0}, "--curve 0"),
        ({"damping": 2.0}, "--damping 2"),
        ({"max_speed": 3.0}, "--max-speed 3"),
        ({"max_acceleration": 30.0}, "--max-acceleration 30"),
        ({"bounds": "1:2"}, "--bounds 1:2: write smallest and largest x, y and z"),
        ({"bounds": "0:1,0:1,1:0"}, "--bounds 0:1,0:1,1:0"),
        ({"bounds": "a:b,0:1,0:1"}, "--bounds a:b"),
        ({"keyboard": True, "window": False}, "--keyboard and --no-window do not go together"),
    ],
)
def test_settings_that_cannot_be_get_one_line(change, words):
    with pytest.raises(SettingsError) as refused:
        Settings(**change)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_right_hands_box_is_the_left_ones_mirror_image():
    settings = Settings(bounds=DOCUMENT_BOUNDS)
    np.testing.assert_array_equal(settings.left_bounds(), [[0.2, 0.0, 0.1], [0.4, 0.3, 0.5]])
    np.testing.assert_array_equal(settings.right_bounds(), [[0.2, -0.3, 0.1], [0.4, 0.0, 0.5]])
    assert Settings().left_bounds() is None
    assert Settings().right_bounds() is None


INFO = InfoReply(
    success=True,
    error="",
    status=Status.OK,
    id=1,
    boot_id="a",
    protocol=1,
    version="0",
    robot="toy",
    model_hash="0",
    joint_names=["left", "right"],
    lower=np.array([-1.0, 0.1]),
    upper=np.array([1.0, 2.0]),
    velocity=np.ones(2),
    shoulders=np.zeros((2, 3)),
    reach=np.ones(2),
    presets=["p"],
    default_preset="p",
    kernel="vm",
    waist_joints=[],
    margin=0.01,
    capsules=[],
)


def test_home_is_read_by_the_joints_names(tmp_path):
    file = tmp_path / "home.toml"
    file.write_text("right = 0.5\n")
    np.testing.assert_array_equal(Settings(home=str(file)).home_posture(INFO), [0.0, 0.5])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("middle = 0", "toy has no arm joint 'middle'"),
        ("right = 'up'", "right must be an angle"),
        ("right = true", "right must be an angle"),
        ("right = nan", "right must be an angle"),
        ("right = 3.0", "right is at 3 rad, beyond its 0.1 to 2"),
        ("right", "is no TOML"),
    ],
)
def test_what_is_no_home_gets_one_line(tmp_path, text, words):
    file = tmp_path / "home.toml"
    file.write_text(text)
    with pytest.raises(SettingsError, match=words):
        Settings(home=str(file)).home_posture(INFO)


def test_zeros_must_be_within_the_limits_too():
    with pytest.raises(SettingsError, match="--home zeros: right is at 0 rad"):
        Settings().home_posture(INFO)
    with pytest.raises(SettingsError, match="cannot be read"):
        Settings(home="none.toml").home_posture(INFO)
