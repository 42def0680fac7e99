"""The window: opened where there is a display, left out with one line where there is none."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np
import pytest
from PIL import ImageGrab

from ik_client import Command, WristMotion
from ik_client.robot_end import RobotLink, RobotSilent
from sim_client.motion_panel import PAPER, WELL
from sim_client.window import display_fault

LIMIT = 60.0


@pytest.fixture
def display() -> Iterator[str]:
    """A display of our own without a screen."""
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("Xvfb is not installed")
    read_end, write_end = os.pipe()
    process = subprocess.Popen(
        [server, "-displayfd", str(write_end), "-screen", "0", "800x600x24"],
        pass_fds=[write_end],
        stderr=subprocess.DEVNULL,
    )
    os.close(write_end)
    with os.fdopen(read_end) as answer:
        number = answer.readline().strip()
    try:
        if not number:
            pytest.skip("Xvfb does not start here")
        yield f":{number}"
    finally:
        process.terminate()
        process.wait()


def test_no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim_client.window.sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert display_fault() == "no display, so no window (DISPLAY is not set)"


@pytest.mark.skipif(sys.platform != "linux", reason="displays are named so on Linux")
def test_a_display_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":9876")
    assert display_fault() == "the display cannot be opened, so no window"


def test_a_display_that_is_there(display: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", display)
    assert display_fault() is None


@pytest.mark.parametrize("targets", [[], ["--drag"]], ids=["path", "drag"])
def test_runs_in_a_window(targets: list[str], display: str, service_process) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "sim_client", service_process.tcp_url, "--duration", "1", *targets],
        env={**os.environ, "DISPLAY": display},
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 0, done.stderr
    assert "headless" not in done.stdout
    assert "0 ticks without a command" in done.stdout
    assert "1.0 s simulated" in done.stdout


def panel_seen(display: str) -> bool:
    """Whether a good deal of the screen has the colour of the panel's paper, and some of it that of a good bar."""
    pixels = np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB")).astype(int)
    paper, bar = (int((np.abs(pixels - colour).max(axis=2) < 3).sum()) for colour in (PAPER, WELL))
    return paper > 50_000 and bar > 300


def test_a_robot_alone_shows_how_its_wrists_move(display: str) -> None:
    """Arrows and panel come and go, and neither disturbs it: it ends as it always does."""
    program = [sys.executable, "-m", "sim_client", "--listen", "127.0.0.1:0", "--eyes-to", "off"]
    environment = {**os.environ, "DISPLAY": display}
    robot = subprocess.Popen(program, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert robot.stdout is not None
        url = f"tcp://{json.loads(robot.stdout.readline())['listen']}"
        twists = np.full((2, 6), 0.2)
        motion = WristMotion(twists, twists, np.array([0.01, 0.001]), ("", "joint"), (None, "right_elbow_joint"))
        with RobotLink(url, connect_timeout=LIMIT) as link:
            seq = 0
            for shown in (motion, None, motion):
                end = time.monotonic() + LIMIT
                while seq % 25 or panel_seen(display) != (shown is not None):
                    assert time.monotonic() < end, "the panel does not come" if shown else "the panel stays"
                    time.sleep(link.welcome.period)
                    with contextlib.suppress(RobotSilent):  # Without a graphics card a picture may take that long.
                        state, seq = link.read(), seq + 1
                        q = state.q if state.q_set is None else state.q_set
                        link.send(Command(q, np.zeros(len(q)), 0.0, session="window", seq=seq, motion=shown))
                seq += 1
        robot.send_signal(signal.SIGTERM)
        _, said = robot.communicate(timeout=LIMIT)
    finally:
        robot.kill()
        robot.communicate()
    assert robot.returncode == 0, said
    assert "headless" not in said
    assert "Traceback" not in said


def test_dragging_without_a_display_is_one_line(service_process) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-m", "sim_client", service_process.tcp_url, "--drag"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 2
    assert done.stderr == "ik-sim: --drag needs a window: no display, so no window (DISPLAY is not set)\n"
