"""OpenWBT's client, byte for byte, against a real service, with and without the habits of its own server."""

import json
import socket
import struct
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from ik_proto import JSON, SolveRequest, request_document
from ik_service.dispatcher import Dispatcher
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.openwbt import FIRST_LAGGED_REPLY, OpenwbtConnection
from ik_service.service import Service
from ik_service.solver import Solver
from ik_service.worker import Worker

MakeDocument = Callable[[int], dict[str, Any]]


class OpenwbtClient:
    """How OpenWBT's `IKClient` behaves on the wire, faults included.

    Header and body in two `send`s, Nagle's algorithm on, one `recv(4)` for the header, a timeout of one second, and
    after any failure it is dead for ever.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self.socket.settimeout(1.0)
        self.socket.connect(address)
        self.connected = True
        self.last_body = b""

    def solve(self, request: dict[str, Any]) -> list[float]:
        """The solution, or the request's own joints when anything fails."""
        if not self.connected:
            return request["current_lr_arm_q"]
        try:
            payload = json.dumps(request).encode("utf-8")
            self.socket.send(struct.pack(">I", len(payload)))
            self.socket.send(payload)
            (length,) = struct.unpack(">I", self.socket.recv(4))
            body = b""
            while len(body) < length:
                part = self.socket.recv(length - len(body))
                if not part:
                    raise ConnectionError
                body += part
            self.last_body = body
            reply = json.loads(body.decode("utf-8"))
        except Exception:
            self.connected = False
            return request["current_lr_arm_q"]
        return reply["sol_q"] if reply["success"] else request["current_lr_arm_q"]

    def close(self) -> None:
        self.socket.close()


@pytest.fixture
def openwbt_client() -> Iterator[Callable[[Any], OpenwbtClient]]:
    clients: list[OpenwbtClient] = []

    def connect(service: Any) -> OpenwbtClient:
        clients.append(OpenwbtClient(service.tcp))
        return clients[-1]

    yield connect
    for client in clients:
        client.close()


@pytest.fixture(scope="session")
def truth(solver: Solver) -> Callable[[SolveRequest], np.ndarray]:
    """The solution of a request by a solver in this process."""
    return lambda request: solver.solve(request.left_wrist, request.right_wrist, request.q).q


def test_the_unmodified_client_is_answered(
    service_process: Any,
    openwbt_client: Callable[[Any], OpenwbtClient],
    openwbt_document: MakeDocument,
    solve_request: Callable[[int], SolveRequest],
    truth: Callable[[SolveRequest], np.ndarray],
) -> None:
    client = openwbt_client(service_process)
    for seed in range(20):
        np.testing.assert_allclose(client.solve(openwbt_document(seed)), truth(solve_request(seed)), atol=1e-6)
    assert client.connected


def test_the_three_keys_it_knows_come_first(
    service_process: Any, openwbt_client: Callable[[Any], OpenwbtClient], openwbt_document: MakeDocument
) -> None:
    client = openwbt_client(service_process)
    client.solve(openwbt_document(0))
    reply = json.loads(client.last_body)
    assert list(reply)[:3] == ["sol_q", "success", "error_msg"]
    assert reply["error_msg"] == ""
    assert len(reply["sol_q"]) == 14


@pytest.mark.parametrize(
    "fault",
    [{"left_wrist": [[float("nan")] * 4] * 4}, {"right_wrist": [[1.0] * 3] * 3}, {"current_lr_arm_q": [0.0] * 13}],
)
def test_bad_input_leaves_it_alive(
    service_process: Any,
    openwbt_client: Callable[[Any], OpenwbtClient],
    openwbt_document: MakeDocument,
    fault: dict[str, Any],
) -> None:
    client = openwbt_client(service_process)
    request = {**openwbt_document(1), **fault}
    assert client.solve(request) == request["current_lr_arm_q"]
    assert json.loads(client.last_body)["status"] == "bad_request"
    assert client.connected
    assert client.solve(openwbt_document(2)) != openwbt_document(2)["current_lr_arm_q"]


def test_lag_gives_every_answer_one_late_and_leaks_none_to_the_next_client(
    start_service: Callable[..., Any],
    openwbt_client: Callable[[Any], OpenwbtClient],
    openwbt_document: MakeDocument,
    solve_request: Callable[[int], SolveRequest],
    truth: Callable[[SolveRequest], np.ndarray],
) -> None:
    service = start_service("--openwbt-lag", "--zenoh", "off")
    for _ in range(2):
        client = openwbt_client(service)
        client.solve(openwbt_document(0))
        assert client.last_body == b'{"sol_q": null, "success": false, "error_msg": ""}'
        assert len(client.last_body) == 50
        for seed in range(1, 5):
            answer = client.solve(openwbt_document(seed))
            np.testing.assert_allclose(answer, truth(solve_request(seed - 1)), atol=1e-6)


def test_smoothing_over_the_wire_starts_anew_for_every_client(
    start_service: Callable[..., Any],
    openwbt_client: Callable[[Any], OpenwbtClient],
    openwbt_document: MakeDocument,
    solve_request: Callable[[int], SolveRequest],
    truth: Callable[[SolveRequest], np.ndarray],
) -> None:
    service = start_service("--smooth", "openwbt", "--collision", "report", "--zenoh", "off")
    raw = [truth(solve_request(seed)) for seed in range(6)]
    for _ in range(2):
        client = openwbt_client(service)
        answers = [client.solve(openwbt_document(seed)) for seed in (0, 0, 1, 2, 3, 4, 5)]
        np.testing.assert_allclose(answers[:4], [raw[0], raw[0], raw[1], raw[2]], atol=1e-6)
        for seed in (3, 4, 5):  # the duplicate of the first was skipped, so four samples are there
            expected = 0.4 * raw[seed] + 0.3 * raw[seed - 1] + 0.2 * raw[seed - 2] + 0.1 * raw[seed - 3]
            np.testing.assert_allclose(answers[seed + 1], expected, atol=1e-6)


def test_only_openwbts_requests_get_its_habits(
    engine: Engine,
    openwbt_document: MakeDocument,
    solve_request: Callable[[int], SolveRequest],
    truth: Callable[[SolveRequest], np.ndarray],
) -> None:
    service, worker = Service(engine.copy(), Meter("test")), Worker()
    connection = OpenwbtConnection(Dispatcher(service, service, worker), smooth=True, lag=True)

    def ask(body: bytes) -> dict[str, Any]:
        reply = connection.answer(body, 0.0)
        assert isinstance(reply, bytes)
        return json.loads(reply)

    assert connection.answer(json.dumps(openwbt_document(0)).encode(), 0.0) == FIRST_LAGGED_REPLY
    fresh = ask(JSON.encode(request_document(solve_request(5))))
    assert (fresh["success"], fresh["id"]) == (True, 6)
    late = ask(json.dumps({**openwbt_document(1), "mode": "reach", "stream": 7, "budget_ms": "soon"}).encode())
    np.testing.assert_allclose(late["sol_q"], truth(solve_request(0)), atol=1e-12)
    later = ask(json.dumps(openwbt_document(2)).encode())
    assert later["success"]  # what its own keys are called does not matter


def test_the_preset_of_its_own_server_can_be_had(
    engine: Engine,
    start_service: Callable[..., Any],
    openwbt_client: Callable[[Any], OpenwbtClient],
    openwbt_document: MakeDocument,
    solve_request: Callable[[int], SolveRequest],
) -> None:
    client = openwbt_client(start_service("--preset", "openwbt", "--collision", "off", "--zenoh", "off"))
    request, solver = solve_request(3), engine.copy().solvers["openwbt"]
    expected = solver.solve(request.left_wrist, request.right_wrist, request.q, collision="off")
    np.testing.assert_allclose(client.solve(openwbt_document(3)), expected.q, atol=1e-6)
    assert expected.position_error.max() > 1e-3  # its pull towards zero, which `precise` has not
