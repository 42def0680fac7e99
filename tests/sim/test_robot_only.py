"""`ik-sim --listen` as a process of its own, commanded over its link."""

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ik_client import Command
from ik_client.robot_end import RobotLink, RobotSilent
from ik_proto import Array
from sim_client.cli import EXIT_USAGE, main

LIMIT = 60.0


class RobotProcess:
    """A running `ik-sim --listen`."""

    def __init__(self, *arguments: str) -> None:
        environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "IK_TOKEN")}
        command = [sys.executable, "-m", "sim_client", "--listen", "127.0.0.1:0", "--headless", "--eyes-to", "off"]
        self.process = subprocess.Popen(
            [*command, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment,
        )
        assert self.process.stdout is not None
        assert select.select([self.process.stdout], [], [], LIMIT)[0], "no ready line"
        self.ready = json.loads(self.process.stdout.readline())
        self.url = f"tcp://{self.ready['listen']}"

    def finish(self, number: int) -> tuple[int, str]:
        """Send a signal, wait, and give exit code and standard error."""
        self.process.send_signal(number)
        _, err = self.process.communicate(timeout=LIMIT)
        return self.process.returncode, err.decode()


@pytest.fixture
def start_robot():
    started: list[RobotProcess] = []

    def start(*arguments: str) -> RobotProcess:
        started.append(RobotProcess(*arguments))
        return started[-1]

    yield start
    for robot in started:
        if robot.process.poll() is None:
            robot.process.kill()
            robot.process.communicate()
        for stream in (robot.process.stdout, robot.process.stderr):
            assert stream is not None
            stream.close()


class Loop:
    """Sends commands at the robot's pace, until something is the case."""

    def __init__(self, link: RobotLink) -> None:
        self.link = link
        self.seq = 0

    def until(self, reached: Callable[[], bool], wanted: Callable[[], Array], engaged: bool = False) -> None:
        end = time.monotonic() + LIMIT
        while not reached():
            assert time.monotonic() < end, self.link.read()
            self.seq += 1
            q = wanted()
            self.link.send(Command(q, np.zeros(len(q)), 0.0, session="test", seq=self.seq, engaged=engaged))
            time.sleep(self.link.welcome.period)

    def held(self) -> Array:
        """Where the robot holds its joints, or where they are."""
        state = self.link.read()
        return state.q if state.q_set is None else state.q_set


def weights_until_the_end(link: RobotLink) -> list[float]:
    """The weights that the robot tells of while it ends itself."""
    weights = []
    while True:
        try:
            link.read()
        except RobotSilent:
            return weights
        weights.append(link.weight)
        time.sleep(0.005)


def test_a_robot_asked_to_end_gives_its_arms_back_first(start_robot, tmp_path: Path) -> None:
    """Hazard row "weight ramp / exit": SIGTERM while the weight rises, a real process."""
    file = tmp_path / "robot.json"
    robot = start_robot("--report", str(file))
    assert (robot.ready["robot"], robot.ready["eyes"]) == ("g1", "")
    with RobotLink(robot.url) as link:
        loop = Loop(link)
        loop.until(lambda: link.weight > 0.2, loop.held)
        robot.process.send_signal(signal.SIGTERM)
        weights = weights_until_the_end(link)
    code, err = robot.process.wait(LIMIT), robot.process.stderr.read().decode()
    assert code == 0, err
    assert "the weight is 0: the arms are given back" in err
    assert weights[-1] == 0.0
    # Not all at once: whatever ticks were missed here, the weight passed through values in between.
    assert any(0.02 < weight < 0.18 for weight in weights)
    report = json.loads(file.read_text())
    assert (report["state"], report["weight"], report["takes"]) == ("released", 0.0, 1)


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["following", "holding", "killed loop"])
def test_a_robot_asked_to_end_while_it_moves(start_robot, tmp_path: Path, phase: str) -> None:
    """Hazard rows "weight ramp / exit" and "lost connection", a real process: brakes, holds, gives its arms back."""
    file = tmp_path / "robot.json"
    robot = start_robot("--report", str(file))
    with RobotLink(robot.url) as link:
        loop = Loop(link)
        loop.until(lambda: link.read().ready, loop.held)
        for _ in range(3):
            loop.until(lambda: True, loop.held)
        goal = [loop.held()]

        def onward() -> Array:
            goal[0] = goal[0] + np.where(np.arange(14) % 7 == 0, -0.015, 0.0)
            return goal[0]

        loop.until(lambda: loop.seq % 7 == 0 and loop.link.read().q_set is not None, loop.held)
        goal = [loop.held()]
        begin = loop.seq
        loop.until(lambda: loop.seq >= begin + 40, onward, engaged=True)
        assert link.read().following
        if phase == "killed loop":
            link.close()
            time.sleep(1.0)
        elif phase == "holding":
            time.sleep(0.3)
    code, err = robot.finish(signal.SIGTERM)
    assert code == 0
    assert "the weight is 0" in err
    report = json.loads(file.read_text())
    assert (report["state"], report["weight"]) == ("released", 0.0)
    assert report["largest_velocity"] <= 3.0 * (1 + 1e-5)
    assert report["largest_acceleration"] <= 20.0 * (1 + 1e-5)
    assert report["step_while_disarmed"] <= 1e-6
    assert report["lowest_pelvis"] > 0.7


def test_what_is_no_robot_alone_gets_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch) -> None:
    monkeypatch.delenv("IK_TOKEN", raising=False)
    readable = tmp_path / "token"
    readable.write_text("correct horse battery")
    readable.chmod(0o644)
    cases = {
        ("--listen", "here"): "'here' is not an address",
        ("--listen", "0.0.0.0:0"): "nothing would ask who they are",
        ("--listen", "127.0.0.1:0", "--path", "wave"): "--path is of no use with --listen",
        ("--listen", "127.0.0.1:0", "--duration", "-1"): "--duration -1: must be a positive number",
        ("--listen", "127.0.0.1:0", "--tls-cert", "x"): "--tls-cert and --tls-key belong together",
        ("--listen", "127.0.0.1:0", "--tls-cert", "x", "--tls-key", "y"): "cannot be used (No such file",
        ("--listen", "0.0.0.0:0", "--token-file", str(readable)): "chmod 600",
        ("--listen", "127.0.0.1:0", "--robot", "nobody"): "nobody",
        ("--listen", "127.0.0.1:0", "--eyes-to", "disk"): "--eyes-to disk: give shm, zenoh://HOST:PORT or off",
        ("--eyes-to", "off"): "--eyes-to goes with --listen only",
        ("--insecure",): "--insecure goes with --listen only",
        ("--token-file", "none-such"): "none-such",
    }
    handlers = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    try:
        for arguments, words in cases.items():
            assert main([*arguments, "--headless"]) == EXIT_USAGE
            err = capsys.readouterr().err
            assert words in err, arguments
            assert len(err.strip().splitlines()) == 1
    finally:
        for number, handler in zip((signal.SIGTERM, signal.SIGINT), handlers, strict=True):
            signal.signal(number, handler)
