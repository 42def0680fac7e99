"""The robot's end of a link without a robot, and peers that do as they like."""

import json
import socket
import struct
import threading
import time
from collections.abc import Callable

import numpy as np

from ik_client import Command
from ik_client.robot_end import LinkServer
from ik_proto.robot_link import LinkState, Welcome

N = 2
WELCOME = Welcome("toy", ("left", "right"), 0.02)
TOKEN = "correct horse battery"
LIMIT = 10.0


def wait_for(condition: Callable[[], object], limit: float = LIMIT) -> None:
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.002)


def state(weight: float = 0.0, note: str = "", q: float = 0.0) -> LinkState:
    return LinkState(
        np.full(N, q),
        np.zeros(N),
        5.0,
        None,
        np.full(N, q),
        np.zeros(N),
        weight == 1.0,
        False,
        note,
        weight,
        "released",
    )


def command(seq: int, **fields) -> Command:
    return Command(np.full(N, 0.1), np.zeros(N), 0.0, session="s", seq=seq, **fields)


class Robot:
    """The robot's end without a robot: a thread that publishes a state every few milliseconds, and keeps commands."""

    def __init__(self, port: int = 0, **options) -> None:
        self.server = LinkServer(WELCOME, **options)
        self.port = self.server.start("127.0.0.1", port)
        self.state = self.busy_state = state()
        self.arrivals = []
        self.silent = False
        self.on_arrival = lambda arrival: None
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    @property
    def url(self) -> str:
        return f"tcp://127.0.0.1:{self.port}"

    def _run(self) -> None:
        while not self._ends.wait(0.005):
            for arrival in self.server.take():
                self.arrivals.append(arrival)
                self.on_arrival(arrival)
            if not self.silent:
                self.server.publish(self.state, self.busy_state)

    def stop(self) -> None:
        self._ends.set()
        self._thread.join()
        self.server.close()


class Raw:
    """A peer that does as it likes."""

    def __init__(self, robot: Robot) -> None:
        self.socket = socket.create_connection(("127.0.0.1", robot.port), timeout=LIMIT)

    def send(self, document) -> None:
        self.send_bytes(json.dumps(document).encode())

    def send_bytes(self, body: bytes) -> None:
        self.socket.sendall(struct.pack(">I", len(body)) + body)

    def receive(self) -> dict:
        (length,) = struct.unpack(">I", self._exactly(4))
        return json.loads(self._exactly(length))

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            if not part:
                raise ConnectionError("closed")
            data += part
        return data

    def closed(self) -> bool:
        """Read until the other end closes."""
        try:
            while self.socket.recv(65536):
                pass
        except TimeoutError:
            return False
        except ConnectionError:
            pass
        return True

    def __enter__(self) -> "Raw":
        return self

    def __exit__(self, *_) -> None:
        self.socket.close()


def document(seq: int = 1, **changes) -> dict:
    return {
        "q": [0.1] * N,
        "tau": [0.0] * N,
        "time": 0.0,
        "session": "raw",
        "seq": seq,
        "boot_id": "",
        "engaged": False,
        "release": False,
    } | changes
