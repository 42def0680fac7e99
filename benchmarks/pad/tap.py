"""Listens in between a loop and a robot: when each command passes, and what it says."""

import contextlib
import socket
import threading
import time

import numpy as np

from ik_proto import JSON, FrameDecoder
from ik_proto.robot_link import MAX_LINK_FRAME_BYTES

_CHUNK = 65536


class Tap:
    """A port of this machine that leads to a robot's.

    Attributes:
        url: Where the loop connects.
        commands: For each command that has passed: when [s, monotonic], whether it was engaged, and its joints.
    """

    def __init__(self, robot: str) -> None:
        """Listen.

        Args:
            robot: `tcp://HOST:PORT` of the robot.
        """
        host, _, port = robot.removeprefix("tcp://").rpartition(":")
        self._robot = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"
        self.commands: list[tuple[float, bool, np.ndarray]] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        """Stop listening."""
        self._listener.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                loop, _ = self._listener.accept()
                robot = socket.create_connection(self._robot)
                for end in (loop, robot):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                threading.Thread(target=self._pass_on, args=(loop, robot, self._hear()), daemon=True).start()
                threading.Thread(
                    target=self._pass_on, args=(robot, loop, lambda _data, _now: None), daemon=True
                ).start()

    def _hear(self):
        decoder = FrameDecoder(MAX_LINK_FRAME_BYTES)

        def hear(data: bytes, now: float) -> None:
            for body in decoder.feed(data):
                document = JSON.decode(body)
                if "q" in document:
                    self.commands.append((now, bool(document["engaged"]), np.array(document["q"])))

        return hear

    @staticmethod
    def _pass_on(source: socket.socket, sink: socket.socket, hear) -> None:
        with contextlib.suppress(OSError), source, sink:
            while data := source.recv(_CHUNK):
                now = time.monotonic()
                sink.sendall(data)
                hear(data, now)
