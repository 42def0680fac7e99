"""`ik-demo`: one command, a report and pictures, and nothing left running."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import imageio.v3 as iio
import pytest

from sim_client.gl import NoRendering, find_backend
from sim_client.render import VIEW
from sim_client.robot import CONTROL_PERIOD
from sim_client.service_process import ServiceFailed, ServiceProcess
from sim_client.settings import MAX_VELOCITY

LIMIT = 100.0


def environment(kernel_cache: Path, **changes: str) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return {**kept, "IK_CACHE_DIR": str(kernel_cache), **changes}


def demo(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "sim_client.demo", *arguments]


def answers(port: int) -> bool:
    """Whether anybody listens on a port."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def port_of(text: str) -> int:
    found = re.search(r"tcp://127\.0\.0\.1:(\d+)", text)
    assert found, text
    return int(found[1])


def test_runs_reports_and_leaves_pictures(kernel_cache: Path, tmp_path: Path) -> None:
    try:
        find_backend()
    except NoRendering as fault:
        pytest.skip(str(fault))
    done = subprocess.run(
        demo("--duration", "1", "--out", "here/demo"),
        cwd=tmp_path,
        env=environment(kernel_cache),
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "\x1b" not in done.stdout
    folder = tmp_path / "here" / "demo"
    report = json.loads((folder / "report.json").read_text())
    assert report["ticks"] == 50
    assert report["ticks_without_command"] == 0
    assert iio.imread(folder / "demo.png").shape[0] == VIEW[1]
    assert len(list(iio.imiter(folder / "demo.mp4", plugin="pyav"))) == 25
    assert not answers(port_of(done.stdout))


def test_kill_shows_hold_and_resume_and_works_without_pictures(kernel_cache: Path, tmp_path: Path) -> None:
    # Long enough for a service to start again on a slow machine; it is not waited for.
    done = subprocess.run(
        demo("--kill", "--duration", "12", "--out", str(tmp_path)),
        env=environment(kernel_cache, MUJOCO_GL="off"),
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "holding the last command" in done.stdout
    assert "MUJOCO_GL=off turns rendering off" in done.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["ticks_without_command"] == 0
    assert report["holding_ticks"] > 0
    assert report["largest_step"] <= MAX_VELOCITY * CONTROL_PERIOD * 1.000001
    assert not (tmp_path / "demo.mp4").exists()
    assert not answers(port_of(done.stdout))


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a child with its parent")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_child_is_left_behind(number: int, kernel_cache: Path, tmp_path: Path) -> None:
    process = subprocess.Popen(
        demo("--duration", "600", "--out", str(tmp_path)),
        env=environment(kernel_cache, MUJOCO_GL="off"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        port = port_of(next(line for line in process.stdout if "follows" in line))
        assert answers(port)
        process.send_signal(number)
        _, err = process.communicate(timeout=LIMIT)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == (-signal.SIGKILL if number == signal.SIGKILL else 0)
    assert err == ""
    end = time.monotonic() + LIMIT
    while answers(port):
        assert time.monotonic() < end, "the service outlived the demonstration"
        time.sleep(0.05)


def test_a_service_that_does_not_start_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ServiceFailed) as fault:
        ServiceProcess("no_such_robot", tmp_path / "logs" / "service.log")
    assert "no_such_robot" in str(fault.value)
    assert "\n" not in str(fault.value)


def test_a_service_is_killed_and_restarted_on_its_port(
    kernel_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("IK_CACHE_DIR", str(kernel_cache))
    with ServiceProcess("g1", tmp_path / "service.log") as service:
        port = port_of(service.url)
        assert answers(port)
        service.kill()
        assert not answers(port)
        service.restart()
        end = time.monotonic() + LIMIT
        while not answers(port):
            assert time.monotonic() < end
            time.sleep(0.05)
    assert not answers(port)


def test_help_names_everything() -> None:
    done = subprocess.run(demo("--help"), capture_output=True, text=True, timeout=LIMIT)
    assert done.returncode == 0
    for words in ("--kill", "--headless", "--out DIR", "exit codes:"):
        assert words in done.stdout
