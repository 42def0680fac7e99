"""The process that draws what the robot's eyes see: a program of its own, started by `eye_supervisor`.

    python -m sim_client.eye_process BACKEND URL ROBOT DESCRIPTOR

- It reads the robot's posture from the memory it inherits, and publishes pictures at the URL, at most `RATE` a second,
  while somebody waits for one: none is drawn that nobody would see. A picture is of the first posture after it was due;
  one that is late is not made up for.
- On standard output it says, each as a line of JSON: {"ready": true}, or {"fault": WHY, "rendering": whether that is
  because this backend cannot render}, before it ends.
- It ends when its standard input does: that is, with its parent, however that ends.
"""

import json
import select
import signal
import sys
import time
from typing import TYPE_CHECKING

from ik_client.eyes import EyePublisher, EyesError, open_publisher
from ik_proto.robots import load_description
from ik_proto.stereo_packet import StereoFrame
from sim_client.posture_memory import Posture, PostureMemory

if TYPE_CHECKING:
    from sim_client.eye_camera import EyeCamera

RATE = 30.0
"""Most pictures a second."""

EXIT_FAULT = 3

_IDLE_POLL = 0.05
_POLL = 0.001


def main(arguments: list[str]) -> int:
    """Run until the parent ends.

    Args:
        arguments: Backend, URL, robot, and the descriptor of the posture's memory.

    Returns:
        The exit code: 0 at the parent's end, else `EXIT_FAULT`.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent.
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(0))
    backend, url, robot, descriptor = arguments
    description = load_description(robot)
    try:
        publisher = open_publisher(url, description.name)
    except EyesError as error:
        return _fail(str(error), rendering=False)
    try:
        from sim_client.eye_camera import EyeCamera
        from sim_client.scene import build_scene

        model = build_scene(description)
        memory = PostureMemory(model.nq, int(descriptor))
        try:
            camera = EyeCamera(model, backend)
        except Exception as error:  # a backend that does not work may raise anything
            return _fail(str(error), rendering=True)
        _say({"ready": True})
        try:
            _serve(publisher, camera, memory)
        finally:
            camera.close()
    except BrokenPipeError:  # the parent has ended while we spoke
        return 0
    finally:
        publisher.close()
    return 0


def _serve(publisher: EyePublisher, camera: "EyeCamera", memory: PostureMemory) -> None:
    """Publish pictures until the parent ends."""
    seq, due = 0, 0.0
    while True:
        watched = publisher.watched
        if _parent_ended(0.0 if watched else _IDLE_POLL):
            return
        if not publisher.wanted:
            time.sleep(_POLL if watched else 0.0)
            continue
        now = time.monotonic()
        due = now if now > due + 1.0 / RATE else due
        posture = _posture_after(memory, due)
        if posture is None:  # the robot does not move its time on
            continue
        due += 1.0 / RATE
        seq = (seq + 1) % 2**32
        left, right = camera.take(posture.qpos)
        publisher.publish(StereoFrame(seq, 1e3 * posture.time, left, right, camera.fov_deg))


def _posture_after(memory: PostureMemory, due: float) -> Posture | None:
    """The first posture from a time on; None where none comes for a while."""
    end = max(due, time.monotonic()) + _IDLE_POLL
    while time.monotonic() < end:
        posture = memory.read()
        if posture is not None and posture.time >= due:
            return posture
        time.sleep(_POLL)
    return None


def _parent_ended(timeout: float) -> bool:
    """Whether the parent has closed our standard input; waits so long for that [s]."""
    return bool(select.select([sys.stdin], [], [], timeout)[0])


def _fail(fault: str, *, rendering: bool) -> int:
    _say({"fault": " ".join(fault.split()), "rendering": rendering})
    return EXIT_FAULT


def _say(document: dict) -> None:
    print(json.dumps(document), flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
