"""Fixtures of the daemon's tests: an engine in this process, requests with known answers, and raw sockets."""

import asyncio
import json
import select
import socket
import struct
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

import numpy as np
import pytest
import uvloop
from tcp_tools import LIMIT_S, Run

from ik_proto import MAX_BATCH, MAX_STARTS, SolveRequest, request_document
from ik_service.config import Config
from ik_service.engine import Engine
from ik_service.solver import Solver

SOCKET_LIMIT_S = 10.0
CLEAR = 0.015
"""Clearance of a posture that avoidance leaves alone [m]."""


@pytest.fixture(scope="session")
def engine() -> Engine:
    """The G1 with the interpreted kernel, which needs no compiler."""
    return Engine.build(Config(kernel="vm"), "boot-of-test", "0.0.test")


@pytest.fixture(scope="session")
def solve_request(engine: Engine) -> Callable[[int], SolveRequest]:
    """Make a request from a seed that is reachable and clear of the body: targets of a posture, and a q near it."""
    robot, gauge = engine.robot, engine.gauge.copy()
    middle, half = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2

    def make(seed: int = 0) -> SolveRequest:
        rng = np.random.default_rng(seed)
        while True:
            posture = middle + rng.uniform(-0.5, 0.5, robot.nq) * half
            q = np.clip(posture + rng.normal(0.0, 0.02, robot.nq), robot.lower, robot.upper)
            left, right = robot.fk(posture)
            if min(gauge.measure(left, right, each, "report").clearance for each in (q, posture)) > CLEAR:
                return SolveRequest(left_wrist=left, right_wrist=right, q=q, dq=np.zeros(robot.nq), id=seed + 1)

    return make


@pytest.fixture(scope="session")
def solver(engine: Engine) -> Solver:
    """The default preset's solver, as the service's own but not the same."""
    return engine.copy().solvers[engine.about.default_preset]


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


@pytest.fixture(scope="session")
def endless(document: Callable[..., dict[str, Any]]) -> dict[str, Any]:
    """A batch that keeps the worker busy for the rest of a test: a quarter of a million starts in vain."""
    far = np.eye(4)
    far[0, 3] = 2.0
    row = document(left_wrist=far.tolist(), right_wrist=far.tolist(), dq=None)
    rows = {name: [value] * MAX_BATCH for name, value in row.items() if isinstance(value, list)}
    return {"verb": "solve_batch", "mode": "reach", "starts": MAX_STARTS, "id": 99, **rows}


@pytest.fixture(params=[asyncio.new_event_loop, uvloop.new_event_loop], ids=["asyncio", "uvloop"])
def run(request: pytest.FixtureRequest) -> Run:
    """Run a coroutine in a fresh event loop."""

    def run(main: Coroutine[Any, Any, None]) -> None:
        with asyncio.Runner(loop_factory=request.param) as runner:
            runner.run(asyncio.wait_for(main, LIMIT_S))

    return run


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

    def has_reply(self) -> bool:
        """Whether something has come that was not received yet."""
        return bool(select.select([self.socket], [], [], 0.0)[0])

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
