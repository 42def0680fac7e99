"""The window: opened where there is a display, left out with one line where there is none."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator

import pytest

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
