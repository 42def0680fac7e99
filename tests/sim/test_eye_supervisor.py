"""The process of the eyes, as the robot's process keeps it: what is tried, what is said, what is left behind."""

import threading
import time
import uuid
from collections.abc import Callable

import numpy as np
import pytest

from ik_client.eyes import EyesError, block_file, open_eyes, open_publisher
from sim_client.eye_supervisor import EyeSupervisor
from sim_client.gl import PACKAGES
from sim_client.posture_memory import Posture, PostureMemory
from sim_client.robot import SimRobot

LIMIT = 60.0


def until(reached: Callable[[], object]) -> None:
    end = time.monotonic() + LIMIT
    while not reached():
        assert time.monotonic() < end
        time.sleep(0.005)


def there(url: str) -> bool:
    try:
        open_eyes(url, "g1").close()
    except EyesError:
        return False
    return True


@pytest.fixture
def url() -> str:
    return f"shm:{block_file.PREFIX}test-{uuid.uuid4().hex[:12]}"


@pytest.mark.parametrize(
    ("chosen", "words", "starts"),
    [
        ("off", "MUJOCO_GL=off turns rendering off", 0),
        (
            "no_such_backend",
            f"OpenGL (no_such_backend) does not work here; on Debian or Ubuntu: apt install {PACKAGES}",
            1,
        ),
    ],
)
def test_a_machine_that_cannot_render_says_so_once(monkeypatch, url, chosen, words, starts):
    monkeypatch.setenv("MUJOCO_GL", chosen)
    said, gone = [], threading.Event()
    eyes = EyeSupervisor(url, "g1", 29, said.append, gone.set)
    try:
        until(gone.is_set)
        eyes.show(0.0, np.zeros(29))
        assert said == [f"no pictures: {words}"]
        assert eyes.starts == starts
        assert not there(url)
    finally:
        eyes.close()


def test_a_place_that_is_taken_is_taken_over_when_it_is_free(url, g1):
    """As when a robot is started again at once: the process of its predecessor may still be there."""
    robot, said, gone = SimRobot(g1), [], threading.Event()
    predecessor = open_publisher(url, "g1")
    eyes = EyeSupervisor(url, "g1", robot.model.nq, said.append, gone.set)
    try:
        until(lambda: said)
        assert said == [f"no pictures: {url}: another process publishes there already"]
        predecessor.close()
        until(lambda: there(url) or gone.is_set())
        with open_eyes(url, "g1") as watcher:

            def frame():
                eyes.show(time.monotonic(), robot.data.qpos)
                return watcher.wait(-1, 0.02)

            until(lambda: gone.is_set() or frame())
        if gone.is_set():
            pytest.skip(said[-1])
        assert len(said) == 1
    finally:
        eyes.close()
    assert not there(url)
    assert not (block_file.folder() / url.removeprefix("shm:")).exists()


def test_a_posture_arrives_as_it_was_written():
    memory = PostureMemory(3)
    other = PostureMemory(3, memory.descriptor)
    assert other.read() is None
    for k in range(3):
        memory.write(Posture(0.5 + k, np.array([k, -1.0 / 3.0, 2.0])))
    read = other.read()
    assert read is not None
    assert read.time == 2.5
    np.testing.assert_array_equal(read.qpos, [2.0, -1.0 / 3.0, 2.0])
    other._block.close()
    memory.close()
