"""What all sources share: only the newest frame, every frame once, its age said, faults in one line."""

import math
import queue
import sys
import threading
from pathlib import Path

import pytest
from frames import Clock, number_of, numbered

from camera_client.newest import Newest
from camera_client.playback import Playback
from camera_client.recording import Recording
from camera_client.source import FrameSource, SourceError, open_source
from camera_client.writer import Writer


def recorded(path: Path, times: list[float], held: list[bool | None] | None = None) -> Path:
    """A recording of numbered frames."""
    writer = Writer(path, "a test")
    for k, t in enumerate(times):
        writer.write(k, numbered(10 * k, t, depth=True), held[k] if held else None)
    writer.close()
    return path


@pytest.fixture
def take(tmp_path) -> Path:
    """Ten frames, 0.1 s apart, from a clock that has run for long."""
    return recorded(tmp_path / "take.ikcam", [5000.0 + 0.1 * k for k in range(10)])


def played(path: Path, speed: float = 1.0) -> tuple[Playback, Clock]:
    clock = Clock()
    return Playback(Recording(path), speed, clock, clock.sleep), clock


def test_who_is_slow_gets_the_newest_frame():
    clock = Clock()
    place = Newest(clock)
    line: queue.Queue[int] = queue.Queue()
    for k in range(10):
        clock.sleep(0.1)
        place.put(numbered(k, clock.now))
        line.put(k)
        if line.qsize() > 4:
            line.get()
    clock.sleep(0.02)
    assert number_of(place.take(0.0)) == 9
    assert place.age == pytest.approx(0.02)
    assert place.missed == 9
    # The negative control: the queue of four of the published chain hands out what was three frames ago.
    assert line.get() == 6


def test_a_frame_is_given_once():
    place = Newest()
    place.put(numbered(1, 0.0))
    assert [number_of(place.take(0.0)) for _ in range(2)] == [1, None]


def test_a_frame_that_comes_wakes_who_waits():
    place = Newest()
    threading.Timer(0.05, place.put, [numbered(3, 0.0)]).start()
    assert number_of(place.take(30.0)) == 3


def test_closing_wakes_who_waits():
    place = Newest()
    threading.Timer(0.05, place.close).start()
    assert place.take(30.0) is None


def test_before_the_first_frame_there_is_no_age(take):
    source, _ = played(take)
    assert math.isnan(Newest().age)
    assert math.isnan(source.age)
    source.close()


def test_a_recording_plays_in_real_time(take):
    source, clock = played(take)
    begin = clock.now
    seen = []
    while not source.finished:
        frame = source.next(1.0)
        assert frame is not None
        assert frame.t_capture == pytest.approx(clock.now)
        seen.append((number_of(frame), round(clock.now - begin, 6)))
    assert seen == [(10 * k, round(0.1 * k, 6)) for k in range(10)]
    assert source.next(1.0) is None
    source.close()


def test_who_is_slow_misses_frames_of_a_recording(take):
    """Each takes 0.25 s of its time. No frame is older than the time between two."""
    source, clock = played(take)
    seen, ages = [], []
    while not source.finished:
        seen.append(number_of(source.next(1.0)))
        ages.append(source.age)
        clock.sleep(0.25)
    assert seen == [0, 20, 50, 70, 90]
    assert max(ages) <= 0.1 + 1e-9


def test_a_recording_waits_no_longer_than_it_may(take):
    source, clock = played(take)
    assert number_of(source.next(0.0)) == 0
    assert source.next(0.03) is None
    assert clock.now == pytest.approx(100.03)
    assert source.next(0.03) is None
    assert number_of(source.next(0.05)) == 10
    source.close()


@pytest.mark.parametrize("speed", [0.5, 4.0])
def test_a_recording_plays_faster_or_slower(take, speed):
    source, clock = played(take, speed)
    times = []
    while not source.finished:
        frame = source.next(1.0)
        assert frame is not None
        times.append(frame.t_capture)
    assert times[-1] - times[0] == pytest.approx(0.9 / speed)
    assert clock.now - 100.0 == pytest.approx(0.9 / speed)


@pytest.mark.parametrize("speed", [0.0, -1.0, math.inf, math.nan])
def test_an_impossible_speed_is_one_line(take, speed):
    with pytest.raises(SourceError, match="times as fast") as caught:
        open_source(str(take), speed=speed)
    assert "\n" not in str(caught.value)


def test_the_switch_plays_along(tmp_path):
    source, _ = played(recorded(tmp_path / "t.ikcam", [0.0, 1.0, 2.0], [False, True, None]))
    seen = []
    while not source.finished:
        source.next(9.0)
        seen.append(source.held)
    assert seen == [False, True, None]


def test_a_broken_picture_ends_a_recording_with_a_fault(take):
    content = bytearray(take.read_bytes())
    png = content.index(b"IDAT", content.index(b"00000003.png"))
    content[png + 10] ^= 0xFF
    take.write_bytes(content)
    source, _ = played(take)
    assert [number_of(source.next(1.0)) for _ in range(4)] == [0, 10, 20, None]
    assert source.finished
    assert "frame 3 of" in source.fault
    assert "\n" not in source.fault


def test_a_closed_recording_is_over(take):
    source, _ = played(take)
    source.close()
    source.close()
    assert source.finished
    assert source.next(1.0) is None


def test_closing_a_recording_while_somebody_waits_is_no_fault(take):
    clock = Clock()
    source = Playback(Recording(take), 1.0, clock)

    def sleep(seconds: float) -> None:
        source.close()
        clock.sleep(seconds)

    source._sleep = sleep
    assert source.next(1.0) is not None
    assert source.next(1.0) is None
    assert source.finished
    assert source.fault == ""


def test_a_closed_file_gives_no_frame(take):
    recording = Recording(take)
    recording.close()
    with pytest.raises(SourceError, match="is closed"):
        recording.frame(0)


def test_a_recording_is_opened_by_its_path(take):
    source: FrameSource = open_source(str(take), speed=100.0)
    assert source.has_depth
    assert "32 x 24, 0.9 s" in source.description
    frame = source.next(1.0)
    assert frame is not None
    assert frame.depth is not None
    source.close()


def test_a_cut_recording_says_so(take):
    take.write_bytes(take.read_bytes()[:-3000])
    source, _ = played(take)
    assert "cut off" in source.description
    source.close()


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("nothing.ikcam", "cannot be read"),
        ("webcam:/dev/no-such-video", "cannot be opened"),
        ("webcam:99", "cannot be opened"),
        ("", "cannot be read"),
    ],
)
def test_what_cannot_be_opened_is_one_line(what, said, capfd):
    with pytest.raises(SourceError, match=said) as caught:
        open_source(what)
    assert "\n" not in str(caught.value)
    # Nor does a library say more.
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("what", "library", "module", "extra"),
    [
        ("oak", "depthai", "camera_client.depthai_library", "oak"),
        ("webcam:0", "cv2", "camera_client.opencv", "camera"),
    ],
)
def test_a_library_that_is_missing_is_named(monkeypatch, what, library, module, extra):
    for name in [name for name in sys.modules if name.startswith("camera_client.")]:
        if name != "camera_client.source":
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(SourceError, match=rf'pip install "ik-service\[{extra}\]"') as caught:
        open_source(what)
    assert library in str(caught.value)
