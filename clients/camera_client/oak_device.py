"""Finds an OAK-D, lays out what it does, and starts it. What happens behind the device is in `oak_frames`.

- It sends only what is used: colour in 4:2:0 and 16-bit depth of 640 x 360, no point cloud.
- Depth of one frame never depends on another: a filter over time blurs arms that move.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from camera_client.depthai_library import depthai as dai
from camera_client.oak_frames import FPS, OakFrames, pair_queue
from camera_client.source import SourceError

SIZE = (640, 360)
_STEREO_SIZE = (640, 400)
_UDEV = 'SUBSYSTEM=="usb", ATTRS{idVendor}=="03e7", MODE="0666"'


@dataclass(frozen=True, eq=False)
class OakLink:
    """A running camera.

    Attributes:
        frames: What it sees.
        name: Which it is, for people.
        close: Ends it; may take a while.
    """

    frames: OakFrames
    name: str
    close: Callable[[], None]


def build(pipeline: Any) -> Any:
    """Lay out what the device does.

    Args:
        pipeline: A `depthai.Pipeline` of a device.

    Returns:
        The queue of pairs, see `oak_frames`.
    """
    socket, kind = dai.CameraBoardSocket, dai.ImgFrame.Type
    colour = pipeline.create(dai.node.Camera).build(socket.CAM_A)
    colour = colour.requestOutput(SIZE, type=kind.NV12, fps=FPS, enableUndistortion=True)
    left, right = (
        pipeline.create(dai.node.Camera).build(eye).requestOutput(_STEREO_SIZE, type=kind.GRAY8, fps=FPS)
        for eye in (socket.CAM_B, socket.CAM_C)
    )
    stereo = pipeline.create(dai.node.StereoDepth).build(left, right)
    stereo.setLeftRightCheck(True)
    stereo.setSubpixel(True)
    stereo.initialConfig.postProcessing.temporalFilter.enable = False
    colour.link(stereo.inputAlignTo)
    # Packets in one piece: less delay.
    pipeline.setXLinkChunkSize(0)
    return pair_queue(pipeline, colour, stereo.depth)


def connect(which: str) -> OakLink:
    """Find a camera and start it.

    Args:
        which: Its device id; empty for any.

    Returns:
        The running camera.

    Raises:
        SourceError: There is none, or it cannot be started.
    """
    found = {info.getDeviceId(): info for info in dai.Device.getAllAvailableDevices()}
    if not found:
        if dai.Device.getAllConnectedDevices():
            raise SourceError(
                "the OAK camera is used by another program: end that, or unplug the camera and plug it in"
            )
        raise SourceError(
            "no OAK camera is found: plug it into a USB 3 port; on Linux, once, write "
            f"{_UDEV} into /etc/udev/rules.d/80-movidius.rules, then plug it in again"
        )
    if which and which not in found:
        raise SourceError(f"OAK camera {which} is not found, but {', '.join(found)}")
    name = which or next(iter(found))
    try:
        device = dai.Device(found[name])
    except RuntimeError as error:
        raise SourceError(f"OAK camera {name} cannot be opened ({_first_line(error)}): plug it in again") from None
    try:
        return _start(device, name)
    except RuntimeError as error:
        device.close()
        raise SourceError(f"OAK camera {name} cannot be started ({_first_line(error)}): plug it in again") from None
    except BaseException:
        device.close()
        raise


def _start(device: Any, name: str) -> OakLink:
    if device.getPlatform() != dai.Platform.RVC2:
        raise SourceError(f"OAK camera {name} is not of series 2 (OAK-D, Lite, Pro), which alone is known here")
    # `OakSource` does that.
    device.setMaxReconnectionAttempts(0)
    slow = device.getUsbSpeed() in (dai.UsbSpeed.LOW, dai.UsbSpeed.FULL, dai.UsbSpeed.HIGH)
    pipeline = dai.Pipeline(device)
    queue = build(pipeline)
    pipeline.start()

    def close() -> None:
        pipeline.stop()
        device.close()

    warning = " on USB 2, which is slow: use a USB 3 port and cable" if slow else ""
    return OakLink(OakFrames(queue), f"OAK {device.getDeviceName()} {name}{warning}", close)


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
