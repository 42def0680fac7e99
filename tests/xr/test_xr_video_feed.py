"""The feed: it watches the robot while pages watch, and says why there are no images."""

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from ik_client.eyes import EyesError
from ik_proto.stereo_packet import StereoFrame
from xr_client import video_feed
from xr_client.video_feed import VideoFeed

LIMIT = 20.0


def until(reached: Callable[[], object]) -> None:
    end = time.monotonic() + LIMIT
    while not reached():
        assert time.monotonic() < end
        time.sleep(0.002)


class Video:
    """A video socket without pages."""

    def __init__(self) -> None:
        self.watch = threading.Event()
        self.want = threading.Event()
        self.want.set()
        self.frames: list[StereoFrame] = []

    @property
    def watched(self) -> bool:
        return self.watch.is_set()

    def wait_watched(self, timeout: float) -> bool:
        return self.watch.wait(timeout)

    def wait_wanted(self, timeout: float) -> bool:
        return self.want.wait(timeout)

    def publish(self, frame: StereoFrame) -> None:
        self.frames.append(frame)


class Robot:
    """Gives sources away while it is there."""

    def __init__(self, same_clock: bool = True) -> None:
        self.there = True
        self.same_clock = same_clock
        self.opened = self.open = 0
        self.frame: StereoFrame | None = None

    def __call__(self, url: str, robot: str) -> "Robot":
        assert (url, robot) == ("shm:x", "g1")
        if not self.there:
            raise EyesError(url, "nobody publishes there")
        self.opened += 1
        return self

    def wait(self, after_seq: int, timeout: float) -> StereoFrame | None:
        if not self.there:
            raise EyesError("shm:x", "the robot sends no pictures any more")
        if self.frame is not None and self.frame.seq != after_seq:
            return self.frame
        time.sleep(0.001)
        return None

    def close(self) -> None:
        self.open -= 1

    def __enter__(self) -> "Robot":
        self.open += 1
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def image(seq: int, taken_ms: float = 5.0) -> StereoFrame:
    return StereoFrame(seq, taken_ms, b"left", b"right", 60.0)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(video_feed, "_TURN", 0.01)
    monkeypatch.setattr(video_feed, "LONGEST_PAUSE", 0.02)


@pytest.fixture
def feed() -> Iterator[Callable[..., tuple[VideoFeed, Video]]]:
    made: list[VideoFeed] = []

    def start(robot: Robot, **options) -> tuple[VideoFeed, Video]:
        video = Video()
        made.append(VideoFeed("shm:x", "g1", video, open_source=robot, **options))  # ty: ignore[invalid-argument-type]
        return made[-1], video

    yield start
    for one in made:
        one.close()


def test_the_source_is_open_only_while_a_page_watches(feed):
    robot = Robot()
    one, video = feed(robot)
    for round_ in (1, 2):
        assert robot.open == 0
        video.watch.set()
        until(lambda: robot.open == 1)
        robot.frame = image(round_)
        until(lambda round_=round_: len(video.frames) == round_)
        video.watch.clear()
        until(lambda: robot.open == 0)
    assert robot.opened == 2
    assert one.fault == ""


def test_images_keep_their_time_and_content_and_get_rising_numbers(feed):
    robot = Robot()
    _, video = feed(robot)
    video.watch.set()
    for count, seq in enumerate((7, 8, 1, 2), 1):  # the robot's end was started again after the second
        robot.frame = image(seq, 10.0 * seq)
        until(lambda count=count: len(video.frames) == count)
    assert video.frames == [
        StereoFrame(n, 10.0 * seq, b"left", b"right", 60.0) for n, seq in enumerate((7, 8, 1, 2), 1)
    ]


def test_another_machines_clock_is_not_believed(feed):
    robot = Robot(same_clock=False)
    _, video = feed(robot, clock=lambda: 12.0)
    robot.frame = image(1, taken_ms=1e9)
    video.watch.set()
    until(lambda: video.frames)
    assert video.frames[0].taken_ms == 12_000.0


def test_a_robot_that_goes_and_comes_back(feed):
    robot = Robot()
    one, video = feed(robot)
    robot.frame = image(1)
    video.watch.set()
    until(lambda: len(video.frames) == 1)
    robot.there = False
    until(lambda: "nobody publishes there" in one.fault)
    assert one.fault == "no pictures: shm:x: nobody publishes there"
    robot.there = True
    until(lambda: len(video.frames) == 2)
    assert one.fault == ""


def test_no_fault_is_told_to_nobody(feed):
    robot = Robot()
    robot.there = False
    one, video = feed(robot)
    video.watch.set()
    until(lambda: one.fault)
    video.watch.clear()
    until(lambda: not one.fault)


def test_no_image_is_asked_for_while_none_is_wanted(feed):
    """And the time until one is counts for no silence of the robot."""
    now = [100.0]
    robot = Robot()
    one, video = feed(robot, clock=lambda: now[0])
    video.want.clear()
    robot.frame = image(1)
    video.watch.set()
    until(lambda: robot.open == 1)
    now[0] += 60.0
    time.sleep(0.03)
    assert video.frames == []
    video.want.set()
    until(lambda: video.frames)
    assert one.fault == ""


def test_silence_is_told(feed):
    now = [100.0]
    one, video = feed(Robot(), clock=lambda: now[0])
    video.watch.set()
    time.sleep(0.03)
    assert one.fault == ""
    now[0] += 7.0
    until(lambda: one.fault)
    assert one.fault == "no pictures: the robot has sent none for 7 s"


def test_a_robot_without_pictures_is_explained():
    with VideoFeed("", "g1", Video()) as one:  # ty: ignore[invalid-argument-type]
        assert "--eyes-to off" in one.fault


def test_a_url_of_another_kind_is_explained():
    video = Video()
    with VideoFeed("http://x", "g1", video) as one:  # ty: ignore[invalid-argument-type]
        video.watch.set()
        until(lambda: one.fault)
        assert "write shm:NAME or zenoh://HOST:PORT" in one.fault
