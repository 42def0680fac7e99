"""Recordings: what was written comes back, other tools read and write them, a cut costs no more than its frame."""

import io
import json
import os
import signal
import struct
import subprocess
import sys
import tarfile
import threading
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filmed import MIRROR, film
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from camera_client import recorder
from camera_client.frame import Intrinsics, RgbdFrame
from camera_client.pictures import PictureError, decode_colour, decode_depth, encode_colour, encode_depth
from camera_client.recorder import Recorder
from camera_client.recording import Meta, Recording, RecordingError
from camera_client.writer import Writer

_open: list[Recording] = []


def opened(path: Path) -> Recording:
    """A recording that is closed after the test."""
    _open.append(Recording(path))
    return _open[-1]


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    while _open:
        _open.pop().close()


CAMERA = Intrinsics(515.25, 514.75, 15.5, 11.5)


def frame(t: float = 0.0, *, size: tuple[int, int] = (32, 24), depth: bool = True, seed: int = 0) -> RgbdFrame:
    """A smooth picture with random depth."""
    width, height = size
    x, y = np.meshgrid(4 * np.arange(width), 4 * np.arange(height))
    colour = np.stack([x, y, 0 * x + 30 + seed % 200], axis=2).astype(np.uint8)
    distances = np.random.default_rng(seed).integers(0, 65536, (height, width)).astype(np.uint16) if depth else None
    return RgbdFrame(t, distances, CAMERA, colour)


def written(path: Path, frames: int = 3, *, depth: bool = True, close: bool = True) -> Path:
    writer = Writer(path, "a test")
    for k in range(frames):
        writer.write(k, frame(10.0 + k / 30, depth=depth, seed=k), held=k % 2 == 0)
    writer.close(whole=close)
    return path


@st.composite
def takes(draw: st.DrawFn) -> tuple[list[RgbdFrame], list[bool | None]]:
    """Frames of one camera with their switch."""
    size = draw(st.tuples(st.integers(1, 40), st.integers(1, 40)))
    depth = draw(st.booleans())
    times = draw(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=5, unique=True))
    frames = [frame(t, size=size, depth=depth, seed=draw(st.integers(0, 1 << 30))) for t in sorted(times)]
    return frames, [draw(st.sampled_from((None, True, False))) for _ in frames]


@given(take=takes())
@settings(max_examples=60)
def test_what_was_written_comes_back(tmp_path_factory, take):
    frames, switch = take
    path = tmp_path_factory.mktemp("take") / "take.ikcam"
    writer = Writer(path, "a test")
    for k, (one, held) in enumerate(zip(frames, switch, strict=True)):
        writer.write(2 * k, one, held)
    writer.close()
    recording = opened(path)
    width, height = frames[0].size
    assert recording.meta == Meta(width, height, CAMERA, frames[0].depth is not None, "a test")
    assert [entry.sequence for entry in recording.entries] == [2 * k for k in range(len(frames))]
    assert not recording.cut
    for one, held, (read, read_held) in zip(frames, switch, recording.frames(), strict=True):
        assert (read.t_capture, read_held) == (one.t_capture, held)
        if one.depth is None:
            assert read.depth is None
        else:
            np.testing.assert_array_equal(read.depth, one.depth)
        assert one.colour is not None
        assert read.colour is not None
        # Quality 95 of a smooth picture, whose channels differ by up to 200.
        assert np.abs(read.colour.astype(int) - one.colour).max() <= 16
    recording.close()


def test_other_tools_read_it(tmp_path):
    """Python's own tar and Pillow."""
    path = written(tmp_path / "take.ikcam")
    with tarfile.open(path) as archive:
        names = archive.getnames()
        contents: dict[str, bytes] = {}
        for name in names:
            member = archive.extractfile(name)
            assert member is not None
            contents[name] = member.read()
    assert names == ["meta.json", *(f"0000000{k}.{kind}" for k in range(3) for kind in ("jpg", "png", "time.json"))]
    assert json.loads(contents["meta.json"])["fx"] == CAMERA.fx
    for k, (read, held) in enumerate(opened(path).frames()):
        np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(contents[f"0000000{k}.png"]))), read.depth)
        colour = np.asarray(Image.open(io.BytesIO(contents[f"0000000{k}.jpg"])).convert("RGB"))
        assert read.colour is not None
        # Two decoders may round differently.
        assert np.abs(colour.astype(int) - read.colour).max() <= 4
        assert json.loads(contents[f"0000000{k}.time.json"]) == {"t_capture": read.t_capture, "held": held}


def by_hand(path: Path, files: dict[str, bytes], form: int = tarfile.USTAR_FORMAT) -> Path:
    with tarfile.open(path, "w", format=form) as archive:
        for name, content in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return path


def parts(**changes: Any) -> dict[str, bytes]:
    """The files of a recording of one frame, by Pillow; `meta` and `line` change what they say."""
    one = frame()
    assert one.colour is not None
    assert one.depth is not None
    jpeg, png = io.BytesIO(), io.BytesIO()
    Image.fromarray(one.colour).save(jpeg, "JPEG", quality=95)
    Image.fromarray(one.depth).save(png, "PNG")
    meta: dict[str, Any] = {"format": "ikcam", "version": 1, "width": 32, "height": 24, "depth": True}
    meta |= {"fx": 515.25, "fy": 514.75, "cx": 15.5, "cy": 11.5}
    line = {"t_capture": 1.5, "held": True}
    return {
        "meta.json": json.dumps(meta | changes.get("meta", {})).encode(),
        "00000007.jpg": jpeg.getvalue(),
        "00000007.png": png.getvalue(),
        "00000007.time.json": json.dumps(line | changes.get("line", {})).encode(),
    }


@pytest.mark.parametrize("form", [tarfile.USTAR_FORMAT, tarfile.GNU_FORMAT, tarfile.PAX_FORMAT])
def test_other_tools_write_it(tmp_path, form):
    recording = opened(by_hand(tmp_path / "take.ikcam", parts(), form))
    ((read, held),) = recording.frames()
    assert (read.t_capture, held, recording.entries[0].sequence) == (1.5, True, 7)
    np.testing.assert_array_equal(read.depth, frame().depth)


def test_the_systems_tar_writes_and_reads_it(tmp_path):
    for name, content in parts().items():
        (tmp_path / name).write_bytes(content)
    subprocess.run(["tar", "--format=ustar", "-cf", "take.ikcam", *parts()], cwd=tmp_path, check=True)
    assert len(opened(tmp_path / "take.ikcam")) == 1
    listed = subprocess.run(
        ["tar", "-tf", written(tmp_path / "ours.ikcam")], check=True, capture_output=True, text=True
    )
    assert listed.stdout.splitlines()[:2] == ["meta.json", "00000000.jpg"]


@pytest.mark.parametrize("depth", [True, False])
def test_a_cut_anywhere_costs_only_what_is_behind_it(tmp_path, depth):
    whole = written(tmp_path / "whole.ikcam", depth=depth, close=False).read_bytes()
    full = list(opened(tmp_path / "whole.ikcam").frames())
    rng = np.random.default_rng(0)
    blocks = {at + d for at in range(0, len(whole) + 1, 512) for d in (-1, 0, 1)}
    sizes = sorted(k for k in blocks | set(rng.integers(0, len(whole), 200).tolist()) if 0 <= k <= len(whole))
    known = []
    for size in sizes:
        path = tmp_path / "cut.ikcam"
        path.write_bytes(whole[:size])
        try:
            recording = opened(path)
        except RecordingError as error:
            assert "\n" not in str(error)
            known.append(0)
            continue
        for (got, held), (want, want_held) in zip(recording.frames(), full, strict=False):
            assert (got.t_capture, held) == (want.t_capture, want_held)
            np.testing.assert_array_equal(got.depth, want.depth)
        known.append(len(recording))
        recording.close()
    assert known == sorted(known)
    assert set(known) == {0, 1, 2, 3}


def test_an_end_of_zeros_is_an_end(tmp_path):
    """What a file system may leave after a crash of the machine."""
    path = written(tmp_path / "take.ikcam", close=False)
    with path.open("ab") as file:
        file.write(bytes(5000))
    assert len(opened(path)) == 3


@given(data=st.data())
@settings(max_examples=150)
def test_damage_never_surprises(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("damaged")
    content = bytearray(written(folder / "take.ikcam").read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    (folder / "damaged.ikcam").write_bytes(content)
    try:
        recording = Recording(folder / "damaged.ikcam")
    except RecordingError as error:
        assert "\n" not in str(error)
        assert str(error).isprintable()
        return
    try:
        for read, _ in recording.frames():
            assert read.size == (32, 24)
    except RecordingError as error:
        assert "\n" not in str(error)
    finally:
        recording.close()


@given(content=st.binary(max_size=2000))
def test_garbage_is_refused(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("garbage") / "take.ikcam"
    path.write_bytes(content)
    with pytest.raises(RecordingError):
        opened(path)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"meta": {"version": 2}}, "version 1"),
        ({"meta": {"format": "other"}}, "version 1"),
        ({"meta": {"fx": 0.0}}, "impossible camera"),
        ({"meta": {"cy": float("nan")}}, "impossible camera"),
        ({"meta": {"width": 100000}}, "impossible camera"),
        ({"meta": {"width": None}}, "does not describe a camera"),
        ({"meta": {"height": 1e400}}, "does not describe a camera"),
        ({"line": {"t_capture": "soon"}}, "does not say when"),
        ({"line": {"t_capture": float("inf")}}, "impossible time or switch"),
        ({"line": {"held": "yes"}}, "impossible time or switch"),
        ({"line": {"held": [True]}}, "impossible time or switch"),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path, changes, said):
    with pytest.raises(RecordingError, match=said) as caught:
        opened(by_hand(tmp_path / "take.ikcam", parts(**changes)))
    assert "\n" not in str(caught.value)


def test_frames_that_go_back_in_time_are_refused(tmp_path):
    later = {name.replace("7", "8"): content for name, content in parts().items() if name != "meta.json"}
    with pytest.raises(RecordingError, match=r"frame 8 .* impossible time"):
        opened(by_hand(tmp_path / "take.ikcam", parts() | later))


@pytest.mark.parametrize(
    "order",
    [
        ("00000007.jpg", "meta.json", "00000007.png", "00000007.time.json"),
        ("meta.json", "00000007.png", "00000007.jpg", "00000007.time.json"),
        ("meta.json", "00000007.jpg", "00000007.time.json"),
        ("meta.json", "00000007.jpg", "00000007.jpg", "00000007.png", "00000007.time.json"),
        ("meta.json", "meta.json"),
        ("meta.json", "../../etc/passwd"),
        ("meta.json", "00000007.jpg", "00000008.png"),
        ("meta.json", "\x1b[2J.jpg"),
        ("meta.json",),
        (),
    ],
)
def test_files_out_of_place_are_refused(tmp_path, order):
    files = parts() | {"../../etc/passwd": b"", "00000008.png": parts()["00000007.png"], "\x1b[2J.jpg": b""}
    path = tmp_path / "take.ikcam"
    with tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as archive:
        for name in order:
            info = tarfile.TarInfo(name)
            info.size = len(files[name])
            archive.addfile(info, io.BytesIO(files[name]))
    with pytest.raises(RecordingError) as caught:
        opened(path)
    # A terminal is not to be told what to do by a name.
    assert str(caught.value).isprintable()


def header(name: str, **fields: Any) -> bytes:
    info = tarfile.TarInfo(name)
    for field, value in fields.items():
        setattr(info, field, value)
    return info.tobuf(tarfile.GNU_FORMAT)


@pytest.mark.parametrize(
    "hostile",
    [
        header("00000007.jpg", size=8 << 30),
        # A negative size leads a careless reader round and round.
        header("00000007.jpg", size=-512),
        header("00000007.jpg", type=tarfile.SYMTYPE, linkname="/etc/passwd"),
        header("00000007.jpg", type=tarfile.DIRTYPE),
        header("00000007.jpg", type=tarfile.GNUTYPE_SPARSE),
        header("00000007.jpg", type=tarfile.XHDTYPE, size=1 << 40),
    ],
)
def test_a_hostile_header_is_refused(tmp_path, hostile):
    path = tmp_path / "take.ikcam"
    meta = parts()["meta.json"]
    path.write_bytes(header("meta.json", size=len(meta)) + meta.ljust(512, b"\0") + hostile + bytes(2048))
    with pytest.raises(RecordingError, match="no place for"):
        opened(path)


@pytest.mark.parametrize("kind", ["jpg", "png"])
def test_a_picture_that_claims_to_be_huge_is_not_decoded(tmp_path, kind):
    files = parts()
    name = f"00000007.{kind}"
    if kind == "jpg":
        at = files[name].index(b"\xff\xc0") + 5
        files[name] = files[name][:at] + b"\xff\xff\xff\xff" + files[name][at + 4 :]
    else:
        png = files[name]
        begin = struct.pack(">4sII", b"IHDR", 30000, 30000) + png[24:29]
        files[name] = png[:12] + begin + struct.pack(">I", zlib.crc32(begin)) + png[33:]
    recording = opened(by_hand(tmp_path / "take.ikcam", files))
    with pytest.raises(RecordingError, match=r"frame 7 .* is a .* pixels instead of 32 x 24") as caught:
        recording.frame(0)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", range(0, 400, 7))
def test_a_cut_picture_is_refused(size):
    one = frame()
    assert one.depth is not None
    assert one.colour is not None
    with pytest.raises(PictureError):
        decode_depth(encode_depth(one.depth)[:size], one.size)
    with pytest.raises(PictureError):
        decode_colour(encode_colour(one.colour)[:size], one.size)


def test_depth_of_8_bits_is_refused():
    png = io.BytesIO()
    Image.new("L", (32, 24)).save(png, "PNG")
    with pytest.raises(PictureError, match="16 bits"):
        decode_depth(png.getvalue(), (32, 24))


@pytest.mark.parametrize("missing", ["nothing.ikcam", "."])
def test_a_file_that_cannot_be_read_is_one_line(tmp_path, missing):
    with pytest.raises(RecordingError, match="cannot be read") as caught:
        opened(tmp_path / missing)
    assert "\n" not in str(caught.value)


def test_a_recorder_writes_what_it_is_given(tmp_path):
    out = Recorder(tmp_path / "take.ikcam", "a test")
    assert all(out.write(frame(t, seed=t), held=None) for t in range(5))
    out.close()
    out.close()
    assert (out.written, out.dropped, out.fault) == (5, 0, "")
    assert [entry.t_capture for entry in opened(tmp_path / "take.ikcam").entries] == [0, 1, 2, 3, 4]


def test_a_slow_disk_never_makes_the_operator_wait(tmp_path, monkeypatch):
    """Frames are dropped and counted, and their numbers are missing."""
    free = threading.Event()
    write = Writer.write

    def slow(self: Writer, *job: Any) -> None:
        assert free.wait(30)
        write(self, *job)

    monkeypatch.setattr(Writer, "write", slow)
    out = Recorder(tmp_path / "take.ikcam")
    taken = [out.write(frame(t)) for t in range(30)]
    # One may be in the writer's hands; those that wait are few.
    assert recorder._WAITING <= sum(taken) <= recorder._WAITING + 1
    free.set()
    out.close()
    assert (out.written, out.dropped) == (sum(taken), 30 - sum(taken))
    sequences = [entry.sequence for entry in opened(tmp_path / "take.ikcam").entries]
    assert sequences == [t for t, kept in enumerate(taken) if kept]


def test_a_frame_that_is_not_newer_is_dropped(tmp_path):
    out = Recorder(tmp_path / "take.ikcam")
    assert [out.write(frame(t)) for t in (1.0, 1.0, 0.5, 2.0)] == [True, False, False, True]
    out.close()
    assert (out.written, out.dropped) == (2, 2)
    assert len(opened(tmp_path / "take.ikcam")) == 2


def test_a_full_disk_is_a_fault_and_no_more(tmp_path, monkeypatch):
    out = Recorder(tmp_path / "take.ikcam")
    out.write(frame(0.0))
    assert until(lambda: out.written == 1)

    def full(self: Writer, data: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Writer, "_write", full)
    out.write(frame(1.0))
    assert until(lambda: out.fault)
    assert "No space left on device" in out.fault
    assert not out.write(frame(2.0))
    out.close()
    assert (out.written, out.dropped) == (1, 2)
    assert len(opened(tmp_path / "take.ikcam")) == 1


def until(condition: Any, limit: float = 30.0) -> bool:
    """Whether it comes true in time."""
    pause = threading.Event()
    for _ in range(round(limit / 0.01)):
        if condition():
            return True
        pause.wait(0.01)
    return False


def test_a_crash_loses_no_frame_that_was_written(tmp_path):
    path = tmp_path / "take.ikcam"
    code = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from test_camera_recording import frame, until
from camera_client.recorder import Recorder
out = Recorder(Path(sys.argv[1]))
for t in range(4):
    out.write(frame(t))
assert until(lambda: out.written == 4)
print("ready", flush=True)
time.sleep(60)
"""
    here = str(Path(__file__).parent)
    with subprocess.Popen([sys.executable, "-c", code, str(path), here], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        os.kill(process.pid, signal.SIGKILL)
    assert len(opened(path)) == 4


def test_what_does_not_belong_is_refused(tmp_path):
    out = Recorder(tmp_path / "take.ikcam")
    out.write(frame(0.0))
    one = frame(1.0)
    for wrong in (
        frame(1.0, depth=False),
        frame(1.0, size=(8, 8)),
        RgbdFrame(1.0, one.depth, CAMERA, None),
        RgbdFrame(1.0, one.depth, Intrinsics(1.0, 1.0, 1.0, 1.0), one.colour),
    ):
        with pytest.raises(ValueError, match=r"recorded|recording"):
            out.write(wrong)
    out.close()
    assert out.written == 1


def test_a_recording_without_frames_is_none(tmp_path):
    out = Recorder(tmp_path / "take.ikcam")
    out.close()
    assert not (tmp_path / "take.ikcam").exists()


def test_a_recording_is_never_overwritten(tmp_path):
    path = written(tmp_path / "take.ikcam")
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="exists already"):
        Recorder(path)
    assert path.read_bytes() == before
    with pytest.raises(RecordingError, match="cannot be written"):
        Recorder(tmp_path / "no" / "folder.ikcam")


def test_a_rendered_person_is_filmed(tmp_path, scene):
    """A few frames of what the end-to-end tests play."""
    recording = opened(film(tmp_path / "take.ikcam", scene, MIRROR, lambda t: t > 5.0, fps=0.5))
    assert [entry.held for entry in recording.entries] == [False, False, False, True, True, True, True, True]
    for read, _ in recording.frames():
        assert read.depth is not None
        body = read.depth[read.depth > 0]
        assert 2000 < np.median(body) < 5000
