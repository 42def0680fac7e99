"""An OAK without hardware: what is behind the device runs for real, the device is played.

DepthAI 3.12 makes no node of a device without one ("Pipeline is host only"), so how the graph is laid out is shown on
stand-ins that have only what the real classes have.
"""

import math
import sys
import threading
import time
from collections.abc import Iterator
from datetime import timedelta
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from frames import Clock, number_of, numbered, until

from camera_client import oak, oak_device
from camera_client.depthai_library import depthai as dai
from camera_client.oak import OakSource
from camera_client.oak_device import OakLink, build, connect
from camera_client.oak_frames import OakFrames, OakLost, pair_queue
from camera_client.source import SourceError

WIDTH, HEIGHT = 64, 36
LENS = [[515.0, 0.0, 31.5], [0.0, 516.0, 17.5], [0.0, 0.0, 1.0]]


def colour_message(number: int, taken: timedelta, kind: Any, lens: bool = True) -> Any:
    """Blue is the number, green 100, red 200."""
    message = dai.ImgFrame()
    picture = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    picture[:] = number, 100, 200
    message.setCvFrame(picture, kind)
    message.setTimestamp(taken)
    message.setSequenceNum(number)
    if lens:
        message.setTransformation(dai.ImgTransformation(WIDTH, HEIGHT, LENS))
    return message


def depth_message(number: int, taken: timedelta, size: tuple[int, int] = (WIDTH, HEIGHT)) -> Any:
    """Two metres and as many millimetres as the number."""
    message = dai.ImgFrame()
    message.setType(dai.ImgFrame.Type.RAW16)
    message.setFrame(np.full((size[1], size[0]), 2000 + number, np.uint16))
    message.setWidth(size[0])
    message.setHeight(size[1])
    message.setType(dai.ImgFrame.Type.RAW16)
    message.setTimestamp(taken)
    message.setSequenceNum(number)
    return message


class Camera(dai.node.ThreadedHostNode):
    """Sends colour and depth as a device would, 30 a second or as fast as it is asked."""

    def __init__(self, **options: Any) -> None:
        dai.node.ThreadedHostNode.__init__(self)
        self.colour = self.createOutput()
        self.depth = self.createOutput()
        self.sent = 0
        self.options = {
            "kind": dai.ImgFrame.Type.NV12,
            "period": 1 / 30,
            "count": 1 << 30,
            "depth_late": 0.0,
            "without_depth": (),
            "lens": True,
            "depth_size": (WIDTH, HEIGHT),
        } | options

    def run(self) -> None:
        begin = time.monotonic()
        o = self.options
        for k in range(o["count"]):
            if not self.mainLoop():
                return
            taken = dai.Clock.now()
            try:
                self.colour.send(colour_message(k % 200, taken, o["kind"], o["lens"]))
                if k not in o["without_depth"]:
                    late = timedelta(seconds=o["depth_late"])
                    self.depth.send(depth_message(k % 200, taken + late, o["depth_size"]))
            except dai.MessageQueue.QueueException:
                return
            self.sent = k + 1
            time.sleep(max(0.0, begin + (k + 1) * o["period"] - time.monotonic()))


class Rig:
    """A running pipeline on the host."""

    def __init__(self, size: int = 1, **options: Any) -> None:
        self.pipeline = dai.Pipeline(createImplicitDevice=False)
        self.camera = self.pipeline.create(Camera, **options)
        self.queue = pair_queue(self.pipeline, self.camera.colour, self.camera.depth, size)
        self.frames = OakFrames(self.queue)
        self.pipeline.start()
        self.stopped = False

    def stop(self) -> None:
        if not self.stopped:
            self.stopped = True
            self.pipeline.stop()
            self.pipeline.wait()


@pytest.fixture
def rig() -> Iterator[Any]:
    made: list[Rig] = []

    def make(**options: Any) -> Rig:
        made.append(Rig(**options))
        return made[-1]

    yield make
    for one in made:
        one.stop()


@pytest.mark.parametrize("kind", ["NV12", "BGR888i"])
def test_a_pair_becomes_a_frame(rig, kind):
    before = time.monotonic()
    frames = rig(kind=getattr(dai.ImgFrame.Type, kind)).frames
    frame = frames.next(30.0)
    after = time.monotonic()
    assert frame is not None
    assert frame.colour is not None
    assert frame.depth is not None
    red, green, blue = frame.colour.mean(axis=(0, 1))
    number = int(frame.depth[0, 0]) - 2000
    # 4:2:0 rounds.
    assert (red, green, blue) == pytest.approx((200, 100, number), abs=3)
    assert (frame.depth == 2000 + number).all()
    assert before <= frame.t_capture <= after
    assert 0.0 <= frames.age <= after - before
    camera = frame.intrinsics
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (515.0, 516.0, 31.5, 17.5)


def test_a_frame_was_taken_in_the_middle_of_its_exposure():
    """A camera says when the exposure ended and how long it was."""
    taken = dai.Clock.now()
    asked: list[Any] = []

    def stamp(offset: Any) -> timedelta:
        asked.append(offset)
        return taken

    colour = colour_message(1, taken, dai.ImgFrame.Type.BGR888i)
    played = SimpleNamespace(
        getTimestamp=stamp, getTransformation=colour.getTransformation, getCvFrame=colour.getCvFrame
    )
    queue = SimpleNamespace(get=lambda timeout: {"colour": played, "depth": depth_message(1, taken)})
    assert OakFrames(queue).next(1.0) is not None
    assert asked == [dai.CameraExposureOffset.MIDDLE]


def test_colour_without_depth_is_no_frame(rig):
    frames = rig(without_depth=tuple(range(0, 200, 2)), period=0.04).frames
    depths = []
    for _ in range(8):
        frame = frames.next(30.0)
        assert frame is not None
        assert frame.colour is not None
        assert frame.depth is not None
        depths.append(int(frame.depth[0, 0]) - 2000)
        assert frame.colour[..., 2].mean() == pytest.approx(depths[-1], abs=3)
    assert all(number % 2 for number in depths)


def test_depth_of_another_moment_is_not_taken(rig):
    """Depth is stamped 50 ms late, so that it never is within half a frame of the colour of its number."""
    frames = rig(depth_late=0.05, period=0.2).frames
    assert frames.next(1.5) is None


def test_frames_come_once_and_never_go_back(rig):
    frames = rig(period=0.003).frames
    times = [frame.t_capture for frame in (frames.next(30.0) for _ in range(50)) if frame is not None]
    assert len(times) == 50
    assert times == sorted(set(times))


def test_an_older_pair_is_passed_over():
    """Whatever the queue may do."""
    now = dai.Clock.now()
    pairs = iter(
        {
            "colour": colour_message(k, now - timedelta(seconds=s), dai.ImgFrame.Type.BGR888i),
            "depth": depth_message(k, now),
        }
        for k, s in ((1, 1.0), (2, 2.0), (3, 0.5))
    )
    frames = OakFrames(SimpleNamespace(get=lambda timeout: next(pairs)))
    seen = [frames.next(30.0) for _ in range(2)]
    assert [int(frame.depth[0, 0]) - 2000 for frame in seen if frame and frame.depth is not None] == [1, 3]


@pytest.mark.parametrize(("size", "given"), [(1, 5), (4, 2)])
def test_who_is_slow_gets_the_newest_frame(rig, size, given):
    """Six frames come while one is worked on. The queue of four of the published chain gives one three frames old."""
    running = rig(size=size, count=6, period=0.03)

    def waiting() -> int | None:
        pair = running.queue.front()
        return pair["depth"].getSequenceNum() if pair else None

    assert until(lambda: waiting() == given)
    frame = running.frames.next(0.0)
    assert frame is not None
    assert frame.depth is not None
    assert frame.depth[0, 0] == 2000 + given
    # Nothing newer was on its way.
    assert running.pipeline.isRunning()
    assert until(lambda: running.camera.sent == 6)
    assert running.frames.age >= (5 - given) * 0.03


@pytest.mark.parametrize(
    ("options", "said"),
    [({"lens": False}, "calibration"), ({"depth_size": (32, 36)}, "not aligned")],
)
def test_what_is_no_frame_is_said(rig, options, said):
    with pytest.raises(OakLost, match=said):
        rig(**options).frames.next(30.0)


@pytest.fixture
def graph() -> SimpleNamespace:
    """A pipeline of stand-ins that have only what the real classes have, and what was made in it."""
    made: list[tuple[Any, Any]] = []

    def create(kind: Any) -> Any:
        node = Mock(spec=kind)
        if kind is not dai.node.Sync:
            node.build.return_value = node
        if kind is dai.node.Camera:
            node.requestOutput.side_effect = lambda *a, **k: Mock(spec=dai.Node.Output)
        elif kind is dai.node.StereoDepth:
            node.initialConfig = dai.StereoDepthConfig()
            node.initialConfig.postProcessing.temporalFilter.enable = True
            node.inputAlignTo, node.depth = Mock(), Mock(spec=dai.Node.Output)
        else:
            node.inputs = {"colour": Mock(), "depth": Mock()}
        made.append((kind, node))
        return node

    pipeline = Mock(spec=dai.Pipeline)
    pipeline.create.side_effect = create
    return SimpleNamespace(pipeline=pipeline, made=made)


def test_the_device_is_laid_out_for_little_delay(graph):
    build(graph.pipeline)
    nodes = {kind: [node for made, node in graph.made if made is kind] for kind, _ in graph.made}
    colour, left, right = nodes[dai.node.Camera]
    socket = dai.CameraBoardSocket
    assert [node.build.call_args.args for node in (colour, left, right)] == [
        (socket.CAM_A,),
        (socket.CAM_B,),
        (socket.CAM_C,),
    ]
    asked = colour.requestOutput.call_args
    assert asked.args == ((640, 360),)
    assert asked.kwargs == {"type": dai.ImgFrame.Type.NV12, "fps": 30.0, "enableUndistortion": True}
    for camera in (colour, left, right):
        known = dai.node.Camera.requestOutput.__doc__
        assert all(f"{name}:" in known for name in camera.requestOutput.call_args.kwargs)
    (stereo,) = nodes[dai.node.StereoDepth]
    # A filter over time blurs arms that move.
    assert stereo.initialConfig.postProcessing.temporalFilter.enable is False
    stereo.setLeftRightCheck.assert_called_once_with(True)
    stereo.setSubpixel.assert_called_once_with(True)
    (sync,) = nodes[dai.node.Sync]
    sync.setSyncThreshold.assert_called_once_with(timedelta(seconds=1 / 60))
    sync.out.createOutputQueue.assert_called_once_with(maxSize=1, blocking=False)
    stereo.depth.link.assert_called_once_with(sync.inputs["depth"])
    graph.pipeline.setXLinkChunkSize.assert_called_once_with(0)


def test_a_stand_in_has_nothing_that_the_real_class_has_not(graph):
    with pytest.raises(AttributeError):
        graph.pipeline.create(dai.node.StereoDepth).setSpeed(1)


def test_depthai_makes_no_device_node_without_a_device():
    """Why the graph is shown on stand-ins. When this fails, DepthAI can do more: use it."""
    with dai.Pipeline(createImplicitDevice=False) as pipeline, pytest.raises(RuntimeError, match="host only"):
        pipeline.create(dai.node.Camera)


def test_no_camera_says_what_to_check():
    if dai.Device.getAllConnectedDevices():
        pytest.skip("there is a camera")
    with pytest.raises(SourceError, match=r"no OAK camera is found.*USB 3.*03e7.*rules\.d") as caught:
        connect("")
    assert "\n" not in str(caught.value)


@pytest.fixture
def device(monkeypatch) -> Mock:
    """Plays `depthai.Device` with one camera, ABC, and the pipeline that runs on it."""
    info = SimpleNamespace(getDeviceId=lambda: "ABC")
    device = Mock(spec=dai.Device)
    device.getPlatform.return_value = dai.Platform.RVC2
    device.getUsbSpeed.return_value = dai.UsbSpeed.SUPER
    device.getDeviceName.return_value = "OAK-D-LITE"
    kind = Mock(return_value=device)
    kind.getAllAvailableDevices.return_value = [info]
    kind.getAllConnectedDevices.return_value = [info]
    played = {name: getattr(dai, name) for name in ("Platform", "UsbSpeed")}
    pipeline = Mock(spec=dai.Pipeline)
    monkeypatch.setattr(oak_device, "dai", SimpleNamespace(Device=kind, Pipeline=Mock(return_value=pipeline), **played))
    monkeypatch.setattr(oak_device, "build", lambda pipeline: "a queue")
    device.kind, device.pipeline = kind, pipeline
    return device


@pytest.mark.parametrize("which", ["", "ABC"])
def test_a_camera_is_started(device, which):
    link = connect(which)
    assert link.name == "OAK OAK-D-LITE ABC"
    device.pipeline.start.assert_called_once_with()
    link.close()
    device.pipeline.stop.assert_called_once_with()
    device.close.assert_called_once_with()


def test_usb_2_is_said(device):
    device.getUsbSpeed.return_value = dai.UsbSpeed.HIGH
    assert "USB 2" in connect("").name


def test_what_hinders_is_one_line(device):
    def said() -> str:
        with pytest.raises(SourceError) as caught:
            connect("ABC")
        assert "\n" not in str(caught.value)
        return str(caught.value)

    device.getPlatform.return_value = dai.Platform.RVC4
    assert "series 2" in said()
    device.getPlatform.return_value = dai.Platform.RVC2
    device.pipeline.start.side_effect = RuntimeError("X_LINK_ERROR\nat 0x0")
    assert "cannot be started (X_LINK_ERROR)" in said()
    assert device.close.call_count == 2
    device.kind.side_effect = RuntimeError("no permission\nat 0x0")
    assert "cannot be opened (no permission)" in said()
    device.kind.getAllAvailableDevices.return_value = [SimpleNamespace(getDeviceId=lambda: "XYZ")]
    assert "ABC is not found, but XYZ" in said()
    device.kind.getAllAvailableDevices.return_value = []
    assert "used by another program" in said()


class Cable:
    """Hands out links to pipelines that run on the host; none while it is unplugged."""

    def __init__(self, rig: Any) -> None:
        self.plugged = threading.Event()
        self.plugged.set()
        self.tried = 0
        self.links: list[Rig] = []
        self._rig = rig

    def connect(self, which: str) -> OakLink:
        self.tried += 1
        if not self.plugged.is_set():
            # DepthAI's own errors come from a camera that is just starting.
            raise SourceError("no OAK camera is found") if self.tried % 2 else RuntimeError("X_LINK_ERROR")
        running = self._rig(period=0.005)
        self.links.append(running)
        return OakLink(running.frames, f"OAK {which}", running.stop)

    def unplug(self) -> None:
        self.plugged.clear()
        self.links[-1].stop()


def test_an_unplugged_camera_is_a_fault_until_it_is_back(rig, monkeypatch):
    monkeypatch.setattr(oak, "_RETRY", 0.01)
    cable = Cable(rig)
    source = OakSource("ABC", cable.connect)
    first = source.next(30.0)
    assert first is not None
    assert source.fault == ""
    assert 0.0 <= source.age < 30.0
    cable.unplug()
    # A pair may still wait.
    assert until(lambda: source.next(0.1) is None and source.fault)
    assert source.fault.startswith("OAK ABC is lost")
    assert "\n" not in source.fault
    assert not source.finished
    assert until(lambda: cable.tried > 4)
    assert source.next(0.0) is None
    cable.plugged.set()
    again = source.next(30.0)
    assert again is not None
    assert again.t_capture > first.t_capture
    assert source.fault == ""
    source.close()
    source.close()
    assert source.finished
    assert source.next(1.0) is None
    assert cable.links[-1].stopped


def test_a_silent_camera_is_a_fault(monkeypatch):
    """One that hangs closes no queue."""
    monkeypatch.setattr(oak, "_RETRY", 60.0)
    clock = Clock()
    ended = threading.Event()

    def silence(timeout: float) -> None:
        clock.sleep(timeout)

    frames = SimpleNamespace(next=silence, age=math.nan)
    source = OakSource("", lambda which: OakLink(frames, "OAK", ended.set), clock)  # ty: ignore[invalid-argument-type]
    for _ in range(30):
        assert source.next(0.1) is None
        assert source.fault == ""
    assert source.next(0.2) is None
    assert "has sent nothing for 3 s" in source.fault
    assert ended.wait(30)
    source.close()


def test_a_camera_that_cannot_be_ended_is_looked_for_all_the_same(monkeypatch):
    monkeypatch.setattr(oak, "_RETRY", 0.0)

    def broken() -> None:
        raise RuntimeError("X_LINK_ERROR")

    def lost(timeout: float) -> None:
        raise OakLost("gone")

    shown = SimpleNamespace(next=lambda timeout: numbered(7, 1.0, depth=True), age=0.0)
    links = iter(
        [
            OakLink(SimpleNamespace(next=lost, age=0.0), "OAK", broken),  # ty: ignore[invalid-argument-type]
            OakLink(shown, "OAK", broken),  # ty: ignore[invalid-argument-type]
        ]
    )
    source = OakSource("", lambda which: next(links))
    assert source.next(1.0) is None
    assert number_of(source.next(30.0)) == 7
    source.close()


def test_closing_ends_the_search(rig, monkeypatch):
    monkeypatch.setattr(oak, "_RETRY", 60.0)
    cable = Cable(rig)
    source = OakSource("", cable.connect)
    cable.unplug()
    assert until(lambda: source.next(0.1) is None and source.fault)
    source.close()
    assert cable.tried == 1


def test_closing_from_another_thread_is_no_fault(rig):
    source = OakSource("", Cable(lambda **options: rig(without_depth=range(1 << 30))).connect)
    threading.Timer(0.1, source.close).start()
    assert source.next(30.0) is None
    assert source.finished
    assert source.fault == ""
    source.close()


def test_depthai_says_nothing_on_standard_output(capfd):
    assert "depthai" in sys.modules
    dai.Device.getAllConnectedDevices()
    assert capfd.readouterr() == ("", "")
