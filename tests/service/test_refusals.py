"""What a refusal says to a client: what is wrong and what to do, and nothing of the machine, the code or the secret."""

import json
import logging
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import msgpack
import numpy as np
import pytest
from service_fakes import service_with

from ik_proto import JSON, MSGPACK, STATUS_TABLE, Codec, Status
from ik_service.access import Doorkeeper
from ik_service.dispatcher import LARGE_BODY_BYTES, Dispatcher
from ik_service.engine import Engine
from ik_service.worker import Busy, Job, Worker

TOKEN = "a-secret-of-the-test"
LEAKS = ("Traceback", "File", "/", "\\", ".py", "0x", "\n", TOKEN)
FAULT = OSError(f'File "/home/someone/kernel.py", token {TOKEN}\nTraceback (most recent call last)')


class FullWorker(Worker):
    """Has no room."""

    def submit(self, job: Job, stream: Any = None) -> Future[bytes]:
        raise Busy(16)


def dispatcher(engine: Engine, outcome: Status | Exception = Status.OK, worker: Worker | None = None) -> Dispatcher:
    """One that is trusted already."""
    door = Doorkeeper(TOKEN.encode(), remembers=True)
    assert door.admits({"token": TOKEN})
    return Dispatcher(service_with(engine, outcome), service_with(engine, outcome), worker or Worker(), doorkeeper=door)


def stranger(engine: Engine) -> Dispatcher:
    service = service_with(engine, Status.OK)
    return Dispatcher(service, service, Worker(), doorkeeper=Doorkeeper(TOKEN.encode(), remembers=True))


def ask(asked: Dispatcher, body: bytes, codec: Codec = JSON) -> dict[str, Any]:
    reply = asked.answer(body, codec)
    return codec.decode(reply if isinstance(reply, bytes) else reply.result(10.0))


def check(reply: dict[str, Any], status: Status) -> None:
    assert reply["status"] == status.value
    assert reply["success"] is False
    assert reply["error_msg"]
    for leak in LEAKS:
        assert leak not in reply["error_msg"], reply["error_msg"]
    assert TOKEN not in str(reply)


Make = Callable[[Callable[..., dict[str, Any]]], bytes]
BATCH = {"verb": "solve_batch", "q": [[0.0] * 14] * 2}
BODIES: list[tuple[Status, Make]] = [
    (Status.BAD_REQUEST, lambda document: b""),
    (Status.BAD_REQUEST, lambda document: b"/etc/passwd"),
    (Status.BAD_REQUEST, lambda document: b"[" * 100_000),
    (Status.BAD_REQUEST, lambda document: b"\xff" * (LARGE_BODY_BYTES + 1)),
    (Status.BAD_REQUEST, lambda document: b'"\\ud800"'),
    (Status.BAD_REQUEST, lambda document: json.dumps(document(q=[0.0] * 13)).encode()),
    (Status.BAD_REQUEST, lambda document: json.dumps(document(left_wrist=np.eye(3).tolist())).encode()),
    (Status.BAD_REQUEST, lambda document: json.dumps(document(left_wrist="a/b")).encode()),
    (Status.BAD_REQUEST, lambda document: json.dumps(document(mode="nonsense")).encode()),
    (Status.BAD_REQUEST, lambda document: json.dumps(document(budget_ms=-1.0)).encode()),
    (Status.BAD_REQUEST, lambda document: json.dumps(document(stream="x" * 65)).encode()),
    (Status.BAD_REQUEST, lambda document: json.dumps(document(id="x")).encode()),
    (Status.BAD_REQUEST, lambda document: json.dumps({**document(), "surplus": TOKEN}).encode()),
    (Status.BAD_REQUEST, lambda document: json.dumps(BATCH).encode()),
    (Status.UNSUPPORTED, lambda document: json.dumps(document(verb="nonsense")).encode()),
    (Status.UNSUPPORTED, lambda document: json.dumps(document(v=2)).encode()),
    (Status.UNSUPPORTED, lambda document: json.dumps(document(preset="nonsense")).encode()),
    (Status.EXPIRED, lambda document: json.dumps(document(budget_ms=1e-9)).encode()),
]


@pytest.mark.parametrize(("status", "make"), BODIES)
def test_of_a_body(engine: Engine, document: Callable[..., dict[str, Any]], status: Status, make: Make) -> None:
    check(ask(dispatcher(engine), make(document)), status)


@pytest.mark.parametrize("body", [b"", b"\xc1", b"\x81\xa1q\xc7\x10\x05", b"\x93\x01", msgpack.packb({"verb": "x"})])
def test_of_messagepack(engine: Engine, body: bytes) -> None:
    reply = ask(dispatcher(engine), body, MSGPACK)
    check(reply, Status(reply["status"]))


@pytest.mark.parametrize("body", [b'{"verb": "info"}', b'{"token": "/x"}', b"x" * (LARGE_BODY_BYTES + 1)])
def test_of_a_stranger(engine: Engine, body: bytes) -> None:
    """Hazard row: auth."""
    check(ask(stranger(engine), body), Status.UNAUTHORIZED)


@pytest.mark.parametrize("changes", [{}, {"mode": "reach"}, {"verb": "solve_batch"}])
def test_of_a_fault_of_ours(
    engine: Engine,
    document: Callable[..., dict[str, Any]],
    changes: dict[str, Any],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The traceback goes to the log alone."""
    monkeypatch.setattr(logging.getLogger("ik_service"), "propagate", True)
    plain = document(**changes)
    if "verb" in changes:
        plain |= {name: [value] for name, value in plain.items() if isinstance(value, list)}
    check(ask(dispatcher(engine, FAULT), json.dumps(plain).encode()), Status.INTERNAL)
    assert "kernel.py" in caplog.text


def test_of_a_full_worker(engine: Engine, document: Callable[..., dict[str, Any]]) -> None:
    full = dispatcher(engine, worker=FullWorker())
    check(ask(full, json.dumps(document(mode="reach")).encode()), Status.OVERLOADED)
    check(ask(full, b" " * (LARGE_BODY_BYTES + 1)), Status.OVERLOADED)


def test_of_a_request_that_a_newer_one_of_its_stream_supersedes(
    engine: Engine, document: Callable[..., dict[str, Any]]
) -> None:
    class Waiting(Worker):
        """Never gets to its jobs."""

        def submit(self, job: Job, stream: Any = None) -> Future[bytes]:
            done: Future[bytes] = Future()
            done.set_result(stream.superseded())
            return done

    body = json.dumps(document(mode="reach", stream=TOKEN)).encode()
    check(ask(dispatcher(engine, worker=Waiting()), body), Status.SUPERSEDED)


def test_an_answer_that_is_no_success_tells_nothing_either(
    engine: Engine, document: Callable[..., dict[str, Any]]
) -> None:
    check(ask(dispatcher(engine, Status.NOT_CONVERGED), json.dumps(document()).encode()), Status.NOT_CONVERGED)


def test_every_status_without_success_is_driven_here() -> None:
    driven = {status for status, _ in BODIES} | {
        Status.UNAUTHORIZED,
        Status.INTERNAL,
        Status.OVERLOADED,
        Status.SUPERSEDED,
        Status.NOT_CONVERGED,
    }
    assert driven == {status for status, info in STATUS_TABLE.items() if not info.success}
