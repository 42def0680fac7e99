"""The command `ik-gamepad`: what it says of itself, and of mistakes."""

import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pygame")

from gamepad_client.cli import _parser
from gamepad_client.layout import read_layout

REPO = Path(__file__).resolve().parents[2]
PAGE = REPO / "docs" / "ik-gamepad.md"
PAD = Path(__file__).resolve().parent / "pad_process.py"


def run(*arguments: object, program: list[object] | None = None) -> subprocess.CompletedProcess[str]:
    command = program or [sys.executable, "-m", "gamepad_client"]
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER", "IK_TOKEN")
    return subprocess.run(
        [str(part) for part in (*command, *arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        stdin=subprocess.DEVNULL,
        env={name: value for name, value in os.environ.items() if name not in hidden},
    )


def one_line(result: subprocess.CompletedProcess[str]) -> str:
    assert result.returncode == 2, result
    (line,) = result.stderr.strip().splitlines()
    assert line.startswith("ik-gamepad: ")
    return line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "no gamepad is there: plug one in (ik-gamepad --list shows them), or use --keyboard"),
        (["--keyboard"], "--keyboard needs a window: no display"),
        (["--keyboard", "--no-window"], "do not go together"),
        (["--speed", "9"], "--speed 9: must be from 0.01 to 1.5"),
        (["--bounds", "1"], "write smallest and largest x, y and z"),
        (["--hold", "elsewhere"], "'elsewhere' is no switch: write key:NAME"),
        (["--hold", "key:space"], "needs a window of ours"),
        (["--hold", "pedal:/dev/input/none"], "pedal /dev/input/none: No such file"),
        (["--mapping", "none.toml"], "none.toml cannot be read: No such file"),
        (["--pads", "none.txt"], "none.txt cannot be read: No such file"),
        (["--report", "/proc/none/report.json"], "cannot be written"),
    ],
)
def test_a_mistake_gets_one_line(arguments, words):
    assert words in one_line(run(*arguments))


def test_no_robot_and_no_service_get_one_line_each(robot):
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        free = f"tcp://127.0.0.1:{nobody.getsockname()[1]}"
    with_a_pad: list[object] = [sys.executable, PAD]
    assert "nobody is there" in one_line(run("--robot", free, program=with_a_pad))
    assert free in one_line(run("--robot", robot, "--service", free, program=with_a_pad))


def test_a_home_that_is_in_the_body_gets_one_line(service_process, robot, tmp_path):
    home = tmp_path / "home.toml"
    home.write_text("left_elbow_joint = 1.2\nright_elbow_joint = 1.2\n")
    options = ("--robot", robot, "--service", service_process.tcp_url, "--home", home)
    line = one_line(run(*options, program=[sys.executable, PAD]))
    assert re.search(r"would be -?\d+ mm apart there, and the arms keep 5: choose another posture", line)


def test_list_says_what_is_there():
    assert "no gamepad: plug one in" in run("--list").stdout
    assert "0: Virtual Controller (used)" in run("--list", program=[sys.executable, PAD]).stdout


def test_help_teaches():
    told = run("--help")
    assert told.returncode == 0
    for words in ("examples:", "exit codes:", "PlayStation", "Xbox", "keyboard", "no safety function"):
        assert words in told.stdout


def test_the_page_has_every_option_and_no_other():
    options = {flag for action in _parser()._actions for flag in action.option_strings if flag.startswith("--")}
    page = PAGE.read_text()
    assert options - set(re.findall(r"--[a-z-]+", page)) == {"--help"}
    assert set(re.findall(r"`(--[a-z-]+)", page)) <= options


def test_the_pages_defaults_are_those_of_the_help():
    rows = dict(re.findall(r"^\| `(--[a-z-]+)`[^|]*\| ([\d.]+) \|", PAGE.read_text(), re.MULTILINE))
    helps = {action.option_strings[-1]: action.help or "" for action in _parser()._actions}
    assert len(rows) >= 9
    for flag, default in rows.items():
        assert helps[flag].endswith(f"({default})"), flag


def test_the_pages_mapping_file_can_be_read(tmp_path):
    (block,) = re.findall(r"^```toml\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    file = tmp_path / "mapping.toml"
    file.write_text(block)
    layout = read_layout(file)
    assert layout.buttons["home"] == ("start",)
