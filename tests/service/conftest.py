"""Fixtures of the daemon's tests: an engine in this process, requests with known answers, and raw sockets."""

import json
import socket
import struct
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from ik_proto import SolveRequest, request_document
from ik_service.config import Config
from ik_service.engine import Engine

SOCKET_LIMIT_S = 10.0


@pytest.fixture(scope="session")
def engine() -> Engine:
    """The G1 with the interpreted kernel, which needs no compiler."""
    return Engine.build(Config(kernel="vm"), "boot-of-test", "0.0.test")


@pytest.fixture(scope="session")
def solve_request(engine: Engine) -> Callable[[int], SolveRequest]:
    """Make a reachable request from a seed: targets from a posture in the middle of the limits, q nearby."""

    def make(seed: int = 0) -> SolveRequest:
        rng = np.random.default_rng(seed)
        robot = engine.robot
        middle, half = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2
        posture = middle + rng.uniform(-0.5, 0.5, robot.nq) * half
        left, right = robot.fk(posture)
        return SolveRequest(
            left_wrist=left,
            right_wrist=right,
            q=np.clip(posture + rng.normal(0.0, 0.05, robot.nq), robot.lower, robot.upper),
            dq=np.zeros(robot.nq),
            id=seed + 1,
        )

    return make


@pytest.fixture(scope="session")
def document(solve_request: Callable[[int], SolveRequest]) -> Callable[..., dict[str, Any]]:
    """A solve request as a plain document of lists, with fields changed or, when None, removed."""

    def make(seed: int = 0, **changes: Any) -> dict[str, Any]:
        plain = {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in request_document(solve_request(seed)).items()
        }
        return {name: value for name, value in {**plain, **changes}.items() if value is not None}

    return make


@pytest.fixture(scope="session")
def openwbt_document(solve_request: Callable[..., SolveRequest]) -> Callable[[int], dict[str, Any]]:
    """A request as OpenWBT's client writes it."""

    def make(seed: int = 0) -> dict[str, Any]:
        request = solve_request(seed)
        return {
            "left_wrist": request.left_wrist.tolist(),
            "right_wrist": request.right_wrist.tolist(),
            "current_lr_arm_q": request.q.tolist(),
            "current_lr_arm_dq": request.dq.tolist(),
        }

    return make


class RawClient:
    """A socket and the framing, nothing else."""

    def __init__(self, address: tuple[str, int]) -> None:
        self.socket = socket.create_connection(address, timeout=SOCKET_LIMIT_S)

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def send_frame(self, body: bytes) -> None:
        self.send(struct.pack(">I", len(body)) + body)

    def receive(self) -> dict[str, Any]:
        (length,) = struct.unpack(">I", self._exactly(4))
        return json.loads(self._exactly(length))

    def ask(self, document: dict[str, Any]) -> dict[str, Any]:
        self.send_frame(json.dumps(document).encode())
        return self.receive()

    def is_closed(self) -> bool:
        """Whether the other end closes, or resets, within the socket's limit."""
        try:
            return self.socket.recv(1) == b""
        except ConnectionError:
            return True

    def close(self) -> None:
        self.socket.close()

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            if not part:
                raise EOFError(f"closed after {len(data)} of {count} bytes")
            data += part
        return data


@pytest.fixture
def raw_client() -> Iterator[Callable[[tuple[str, int]], RawClient]]:
    """Connect raw sockets; closed when the test ends."""
    clients: list[RawClient] = []

    def connect(address: tuple[str, int]) -> RawClient:
        clients.append(RawClient(address))
        return clients[-1]

    yield connect
    for client in clients:
        client.close()
