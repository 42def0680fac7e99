"""A webcam: always drained, no depth, intrinsics by its field of view; unplugged and plugged in again."""

import math
import threading
from typing import Any

import cv2
import numpy as np
import pytest
from frames import Clock, number_of, until

from camera_client import webcam
from camera_client.source import SourceError
from camera_client.webcam import WebcamSource, open_capture, pinhole


class FakeCapture:
    """Plays `cv2.VideoCapture`: gives the pictures that a test hands over; None for a camera that is unplugged."""

    def __init__(self, opens: bool = True) -> None:
        self.opens = opens
        self.released = False
        self.grabbed = 0
        self._pictures: list[np.ndarray | None] = []
        self._ready = threading.Semaphore(0)
        self._picture: np.ndarray | None = None

    def show(self, picture: np.ndarray | None) -> None:
        self._pictures.append(picture)
        self._ready.release()

    def isOpened(self) -> bool:  # noqa: N802
        return self.opens

    def get(self, what: int) -> float:
        return {cv2.CAP_PROP_FRAME_WIDTH: 32.0, cv2.CAP_PROP_FRAME_HEIGHT: 24.0}[what]

    def grab(self) -> bool:
        assert not self.released
        if not self.opens or not self._ready.acquire(timeout=30):
            return False
        self._picture = self._pictures.pop(0)
        self.grabbed += 1
        return self._picture is not None

    def retrieve(self) -> tuple[bool, Any]:
        return self._picture is not None, self._picture

    def release(self) -> None:
        self.released = True


def grey(number: int) -> np.ndarray:
    return np.full((24, 32, 3), number, np.uint8)


def opened(*captures: FakeCapture, clock: Any = None, **options: Any) -> WebcamSource:
    given = list(captures)
    return WebcamSource("0", open_capture=lambda which: given.pop(0), clock=clock or Clock(), **options)


def close(source: WebcamSource, capture: FakeCapture) -> None:
    """End it; a real camera's next picture ends the wait of its thread."""
    source._closing.set()
    capture.show(None)
    source.close()
    assert until(lambda: capture.released)


def test_a_picture_becomes_a_frame():
    clock, capture = Clock(50.0), FakeCapture()
    source = opened(capture, clock=clock, latency=0.04, field_of_view=math.radians(70))
    picture = grey(0)
    picture[..., 2] = 200  # red comes last
    capture.show(picture)
    frame = source.next(30.0)
    assert frame is not None
    assert frame.colour is not None
    assert frame.colour[0, 0].tolist() == [200, 0, 0]
    assert frame.depth is None
    assert not source.has_depth
    assert frame.t_capture == pytest.approx(49.96)
    assert source.age == pytest.approx(0.04)
    assert frame.intrinsics == pinhole(32, 24, math.radians(70))
    assert "no depth" in source.description
    assert "70 degrees" in source.description
    assert "40 ms" in source.description
    close(source, capture)


def test_who_is_slow_gets_the_newest_picture():
    capture = FakeCapture()
    source = opened(capture)
    for k in range(20):
        capture.show(grey(k))
    assert until(lambda: capture.grabbed == 20 and source.newest.missed == 19)
    assert number_of(source.next(0.0)) == 19
    assert source.next(0.0) is None
    close(source, capture)


@pytest.mark.parametrize("degrees", [40.0, 60.0, 78.0, 120.0])
def test_the_field_of_view_is_between_the_edges(degrees):
    camera = pinhole(640, 360, math.radians(degrees))
    # The outer edges of the first and the last pixel.
    left, right = camera.rays(np.array([[-0.5, 179.5], [639.5, 179.5]]))
    angle = math.acos(left @ right / np.linalg.norm(left) / np.linalg.norm(right))
    assert math.degrees(angle) == pytest.approx(degrees)
    assert camera.fx == camera.fy


def test_an_unplugged_camera_is_a_fault_until_it_is_back(monkeypatch):
    monkeypatch.setattr(webcam, "_RETRY", 0.0)
    first, closed, second = FakeCapture(), FakeCapture(opens=False), FakeCapture()
    source = opened(first, closed, second)
    first.show(grey(1))
    assert number_of(source.next(30.0)) == 1
    first.show(None)
    assert until(lambda: closed.released)
    assert "still plugged in" in source.fault
    assert "\n" not in source.fault
    assert not source.finished
    second.show(grey(2))
    assert number_of(source.next(30.0)) == 2
    assert source.fault == ""
    assert first.released
    close(source, second)
    assert source.finished


def test_a_camera_that_hangs_does_not_keep_the_program(monkeypatch):
    monkeypatch.setattr(webcam, "_LONGEST_GOODBYE", 0.05)
    capture = FakeCapture()
    source = opened(capture)
    source.close()
    assert source.finished
    assert source.next(30.0) is None
    capture.show(None)
    assert until(lambda: capture.released)


def test_a_camera_that_does_not_open_is_one_line():
    capture = FakeCapture(opens=False)
    with pytest.raises(SourceError, match="webcam 0 cannot be opened") as caught:
        opened(capture)
    assert "\n" not in str(caught.value)
    assert capture.released


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"field_of_view": math.radians(5)}, "degrees"),
        ({"field_of_view": math.nan}, "degrees"),
        ({"latency": -0.1}, "latency"),
        ({"latency": math.inf}, "latency"),
    ],
)
def test_what_cannot_be_is_one_line(options, said):
    with pytest.raises(SourceError, match=said) as caught:
        opened(FakeCapture(), **options)
    assert "\n" not in str(caught.value)


def test_opencv_itself_gives_pictures(tmp_path, monkeypatch):
    """A video plays the camera: OpenCV opens, grabs and decodes, and ends."""
    monkeypatch.setattr(webcam, "_RETRY", 60.0)
    path = str(tmp_path / "camera.avi")
    video = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (64, 48))
    for k in range(8):
        video.write(np.full((48, 64, 3), (20 * k, 0, 200), np.uint8))
    video.release()
    source = WebcamSource(path, open_capture=open_capture)
    assert until(lambda: source.fault)
    frame = source.next(30.0)
    assert frame is not None
    assert frame.colour is not None
    assert frame.size == (64, 48)
    red, _, blue = frame.colour.mean(axis=(0, 1))
    # The last of the eight, its red and blue in their places.
    assert red == pytest.approx(200, abs=10)
    assert blue == pytest.approx(140, abs=10)
    source.close()
