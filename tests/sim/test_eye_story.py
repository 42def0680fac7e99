"""What the eyes of `ik-sim --listen` show to watchers, with real processes, some of which are killed."""

import io
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ik_client import Command, RobotState
from ik_client.eyes import EyesError, EyeSource, block_file, open_eyes
from ik_client.robot_end import RobotLink, RobotSilent
from ik_proto.stereo_packet import StereoFrame
from sim_client.gl import NoRendering, find_backend

LIMIT = 60.0


def until(reached: Callable[[], object], what: str) -> None:
    end = time.monotonic() + LIMIT
    while not reached():
        assert time.monotonic() < end, what
        time.sleep(0.005)


class Robot:
    """A running `ik-sim --listen`."""

    def __init__(self, listen: str = "127.0.0.1:0") -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "sim_client", "--listen", listen, "--headless"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={k: v for k, v in os.environ.items() if k not in ("DISPLAY", "IK_TOKEN")},
        )
        assert self.process.stdout is not None
        assert select.select([self.process.stdout], [], [], LIMIT)[0], "no ready line"
        self.ready = json.loads(self.process.stdout.readline())
        self.block = block_file.folder() / self.ready["eyes"].removeprefix("shm:")

    def eyes_process(self) -> int | None:
        """The child that draws."""
        for file in Path("/proc").glob("[0-9]*/stat"):
            try:
                state, parent = file.read_text().rpartition(")")[2].split()[:2]
            except OSError:
                continue
            if int(parent) == self.process.pid and state != "Z":
                return int(file.parent.name)
        return None

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()


@pytest.fixture
def start_robot() -> Iterator[Callable[..., Robot]]:
    try:
        find_backend()
    except NoRendering as fault:
        pytest.skip(str(fault))
    started: list[Robot] = []

    def start(*arguments: str) -> Robot:
        started.append(Robot(*arguments))
        return started[-1]

    yield start
    for robot in started:
        robot.kill()
        until(lambda robot=robot: not robot.block.exists(), "a block was left behind")
        for stream in (robot.process.stdout, robot.process.stderr):
            assert stream is not None
            stream.close()


def watch(url: str) -> EyeSource:
    """Open the eyes as soon as they can be."""
    end = time.monotonic() + LIMIT
    while True:
        try:
            return open_eyes(url, "g1")
        except EyesError:
            assert time.monotonic() < end
            time.sleep(0.02)


def next_frame(eyes: EyeSource, after: int = -1) -> StereoFrame:
    frame = eyes.wait(after, LIMIT)
    assert frame is not None
    return frame


def pixels(jpeg: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(jpeg))).astype(int)


def difference(a: bytes, b: bytes) -> float:
    """Share of the pixels that differ clearly."""
    return float((np.abs(pixels(a) - pixels(b)).max(axis=2) > 60).mean())


def ended(eyes: EyeSource) -> bool:
    """Whether the source says that there will be no pictures any more."""
    try:
        latest = eyes.wait(-1, 0.0)
        eyes.wait(latest.seq if latest else -1, 0.5)
    except EyesError as error:
        assert "no pictures any more" in str(error)
        return True
    return False


def state_of(link: RobotLink) -> RobotState:
    """The latest state; on a machine with much to do it may be late."""
    end = time.monotonic() + LIMIT
    while True:
        try:
            return link.read()
        except RobotSilent:
            assert time.monotonic() < end
            time.sleep(0.005)


def raise_arms(link: RobotLink, reached: Callable[[], bool]) -> int:
    """Move both arms forward until something is the case; the number of states that came meanwhile."""
    state, seq, times = state_of(link), 0, set()
    goal, end = state.q, time.monotonic() + LIMIT
    while not reached():
        assert time.monotonic() < end, state
        state = state_of(link)
        times.add(state.time)
        ready, seq = state.ready and state.q_set is not None, seq + 1
        if ready:
            goal = goal + 0.03 * (np.arange(14) % 7 == 0) * np.sign(-0.8 - goal)
        else:
            goal = state.q if state.q_set is None else state.q_set
        link.send(Command(goal, np.zeros(14), 0.0, session="test", seq=seq, engaged=ready))
        time.sleep(link.welcome.period)
    return len(times)


def test_eyes_of_a_robot_whose_processes_are_killed(start_robot):
    robot = start_robot()
    url = robot.ready["eyes"]
    with RobotLink(f"tcp://{robot.ready['listen']}") as link:
        assert link.welcome.eyes == url
        with watch(url) as eyes, open_eyes(url, "g1") as other:
            first = next_frame(eyes)
            assert first.fov_deg == 60.0
            assert pixels(first.left).shape == (480, 640, 3)
            assert next_frame(other).seq >= first.seq
            # At home the arms hang beside the robot, where it does not see them; held out before it, it does.
            latest = [first]

            def seen() -> bool:
                newer = eyes.wait(latest[0].seq, 0.0)
                latest[0] = newer or latest[0]
                return newer is not None and difference(first.left, newer.left) > 0.01

            raise_arms(link, seen)
            assert difference(latest[0].left, latest[0].right) > 0.01
            assert latest[0].taken_ms <= 1e3 * time.monotonic()

            drawing = robot.eyes_process()
            assert drawing is not None
            os.kill(drawing, signal.SIGKILL)
            until(lambda: ended(eyes), "a killed process still draws")
        again: list[EyeSource] = []

        def back() -> bool:
            try:
                again[:] = again or [open_eyes(url, "g1")]
                return again[0].wait(-1, 0.0) is not None
            except EyesError:
                return False

        # Meanwhile the robot has gone on.
        assert raise_arms(link, back) > 10
        robot.kill()
    with again[0]:
        until(lambda: ended(again[0]), "nobody says that the robot is gone")
    until(lambda: not robot.block.exists(), "a block of a killed robot")
    successor = start_robot(robot.ready["listen"])
    assert successor.ready["eyes"] == url
    with watch(url) as eyes:
        next_frame(eyes)
    successor.process.send_signal(signal.SIGTERM)
    assert successor.process.wait(LIMIT) == 0
    assert not successor.block.exists()
