"""Both ends of eye images, through shared memory and over Zenoh."""

import json
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator

import pytest
import zenoh

from ik_client.eyes import EyesError, block_file, open_eyes, open_publisher
from ik_client.eyes.over_zenoh import ZenohEyePublisher
from ik_client.eyes.shared import SharedEyePublisher, SharedEyes
from ik_client.eyes.source import check_url
from ik_proto.stereo_packet import StereoFrame

LIMIT = 20.0


def picture(seq: int, size: int = 30_000) -> StereoFrame:
    return StereoFrame(seq, 1e3 * time.monotonic(), bytes([seq % 256]) * size, b"right" * (size // 5), 60.0)


def until(reached: Callable[[], object]) -> None:
    end = time.monotonic() + LIMIT
    while not reached():
        assert time.monotonic() < end
        time.sleep(0.005)


@pytest.fixture
def block_url() -> Iterator[str]:
    name = f"{block_file.PREFIX}test-{uuid.uuid4().hex[:12]}"
    yield f"shm:{name}"
    assert not (block_file.folder() / name).exists(), "a block was left behind"


@pytest.fixture
def hub(free_port) -> Iterator[str]:
    """A Zenoh session that listens, as an IK service does."""
    config = zenoh.Config()
    settings = {
        "mode": "peer",
        "listen/endpoints": [f"tcp/127.0.0.1:{free_port}"],
        "scouting/multicast/enabled": False,
    }
    for path, value in settings.items():
        config.insert_json5(path, json.dumps(value))
    with zenoh.open(config):
        yield f"zenoh://127.0.0.1:{free_port}"


def test_pictures_through_shared_memory(block_url):
    publisher = open_publisher(block_url, "g1")
    assert not publisher.watched
    publisher.publish(picture(1))
    with open_eyes(block_url, "g1") as eyes:
        assert eyes.same_clock
        # The first was taken before anybody watched, and may be an hour old.
        assert eyes.wait(-1, 0.05) is None
        assert publisher.watched
        assert publisher.wanted
        for seq in (2, 3):
            publisher.publish(picture(seq))
            assert not publisher.wanted  # until the watcher has it, and waits for the next
        got = eyes.wait(1, LIMIT)
        assert not publisher.wanted
        assert got is not None
        assert (got.seq, got.left[:1], got.fov_deg) == (3, b"\x03", 60.0)
        assert eyes.wait(3, 0.05) is None
        assert publisher.wanted
        assert eyes.wait(-1, 0.05) == got
        with open_eyes(block_url, "g1") as second:
            publisher.publish(picture(4))
            assert eyes.wait(3, LIMIT) == second.wait(-1, LIMIT)
        publisher.close()
        publisher.close()
        with pytest.raises(EyesError, match="sends no pictures any more") as error:
            eyes.wait(4, LIMIT)
        assert error.value.url == block_url
    with pytest.raises(EyesError, match="nobody publishes there"):
        open_eyes(block_url, "g1")


def test_nobody_watches_when_the_watcher_was_killed(block_url):
    publisher = open_publisher(block_url, "g1")
    code = f"from ik_client.eyes import open_eyes\nopen_eyes({block_url!r}, 'g1').wait(-1, 60.0)"
    watcher = subprocess.Popen([sys.executable, "-c", code])
    until(lambda: publisher.watched)
    with open_eyes(block_url, "g1") as other:
        other.wait(-1, 0.01)
        watcher.kill()
        watcher.wait()
        publisher.publish(picture(1))
        assert other.wait(-1, LIMIT) is not None
    until(lambda: not publisher.watched)
    publisher.close()


def test_a_time_of_looking_that_cannot_be_is_nobodys(block_url):
    publisher = open_publisher(block_url, "g1")
    with SharedEyes(block_url.removeprefix("shm:")) as eyes:
        for now in (2**64 - 1, time.monotonic_ns() + 10**12, 1):
            eyes._block.look(now, 0)
            assert not publisher.watched
    publisher.close()


def test_something_else_in_the_block_is_told_in_words(block_url):
    publisher = SharedEyePublisher(block_url.removeprefix("shm:"))
    with open_eyes(block_url, "g1") as eyes:
        publisher._block.write(b"no picture")
        with pytest.raises(EyesError, match="something else than pictures"):
            eyes.wait(-1, LIMIT)
    publisher._block._words[0] = 0
    with pytest.raises(EyesError, match="another version"):
        open_eyes(block_url, "g1")
    publisher.close()


@pytest.mark.parametrize(
    "url", ["", "shm:", "shm:../x", "shm:a/b", "shm:.x", "tcp://127.0.0.1:1", "zenoh://", "zenoh://h:1/g1", "off"]
)
def test_what_is_no_place_of_pictures(url):
    for take in (check_url, lambda url: open_eyes(url, "g1"), lambda url: open_publisher(url, "g1")):
        with pytest.raises(ValueError, match=r"shm|shared memory") as error:
            take(url)
        assert "\n" not in str(error.value)


def test_pictures_over_zenoh(hub):
    robot = f"robot-{uuid.uuid4().hex[:8]}"
    publisher = open_publisher(hub, robot)
    assert isinstance(publisher, ZenohEyePublisher)
    assert not publisher.watched
    with open_eyes(hub, robot) as eyes, open_eyes(hub, "another") as astray:
        assert not eyes.same_clock
        until(lambda: publisher.watched)
        publisher._publisher.put(b"no picture")
        publisher.publish(picture(7))
        got = eyes.wait(-1, LIMIT)
        assert got is not None
        assert (got.seq, len(got.left)) == (7, 30_000)
        assert eyes.wait(7, 0.05) is None
        assert astray.wait(-1, 0.05) is None
        for seq in (8, 9, 10):
            publisher.publish(picture(seq))
        seen = 7
        while seen != 10:  # those between may be replaced, never put in another order
            later = eyes.wait(seen, LIMIT)
            assert later is not None
            assert later.seq > seen
            seen = later.seq
    until(lambda: not publisher.watched)
    publisher.close()


@pytest.mark.parametrize("take", [open_eyes, open_publisher])
def test_nobody_at_the_address_is_told_in_words(take, free_port):
    with pytest.raises(EyesError, match="start an IK service or a Zenoh router there"):
        take(f"zenoh://127.0.0.1:{free_port}", "g1")


def test_a_robot_with_an_impossible_name_is_told_in_words(hub):
    for take in (open_eyes, open_publisher):
        with pytest.raises(EyesError) as error:
            take(hub, "a//b*")
        assert "\n" not in str(error.value)
