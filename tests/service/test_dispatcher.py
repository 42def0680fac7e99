"""`Dispatcher`: what is answered at once, what the worker gets, and that both are the same answers."""

import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any

import pytest

from ik_proto import JSON, MSGPACK, Codec, SolveRequest, Status, request_document
from ik_service.dispatcher import LARGE_BODY_BYTES, Dispatcher
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.service import Service
from ik_service.worker import Worker

LIMIT_S = 30.0
TIMES = ("solve_us", "server_us")


@pytest.fixture
def worker() -> Iterator[Worker]:
    worker = Worker(waiting=1)
    yield worker
    assert worker.stop(LIMIT_S)


@pytest.fixture
def meters() -> tuple[Meter, Meter]:
    return Meter("test"), Meter("test")


@pytest.fixture
def dispatcher(engine: Engine, worker: Worker, meters: tuple[Meter, Meter]) -> Dispatcher:
    here, there = meters
    return Dispatcher(Service(engine.copy(), here), Service(engine.copy(), there), worker)


def without_times(document: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in document.items() if name not in TIMES}


def padded(document: dict[str, Any]) -> dict[str, Any]:
    """In OpenWBT's form, where more keys are allowed, until it is large."""
    return {**document, "remark": "x" * LARGE_BODY_BYTES}


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=["json", "msgpack"])
def test_what_is_quick_is_answered_at_once(
    dispatcher: Dispatcher, meters: tuple[Meter, Meter], document: Callable[..., dict[str, Any]], codec: Codec
) -> None:
    quick = [document(), document(mode="track"), {"verb": "info"}, {"verb": "fk", "q": document()["q"]}]
    for request in quick:
        reply = dispatcher.answer(codec.encode(request), codec)
        assert isinstance(reply, bytes)
        assert codec.decode(reply)["success"]
    for body in (b"junk", b"", codec.encode({"mode": ["reach"]}), codec.encode({"verb": {}, "mode": 1})):
        reply = dispatcher.answer(body, codec)
        assert isinstance(reply, bytes)
        assert codec.decode(reply)["status"] in ("bad_request", "unsupported")
    assert meters[0].outcomes[Status.OK] == len(quick)
    assert sum(meters[1].outcomes.values()) == 0


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=["json", "msgpack"])
def test_what_takes_long_is_answered_by_the_worker_with_the_same_answer(
    dispatcher: Dispatcher,
    engine: Engine,
    meters: tuple[Meter, Meter],
    document: Callable[..., dict[str, Any]],
    openwbt_document: Callable[[int], dict[str, Any]],
    codec: Codec,
) -> None:
    row = document()
    batch = {name: [value] * 3 for name, value in row.items() if isinstance(value, list)} | {"verb": "solve_batch"}
    for request in (batch, document(mode="reach"), {"verb": "solve_batch", "id": 5}, padded(openwbt_document(1))):
        body = codec.encode(request)
        reply = dispatcher.answer(body, codec)
        assert isinstance(reply, Future)
        expected = Service(engine, Meter("test")).handle_bytes(body, codec)
        assert without_times(codec.decode(reply.result(LIMIT_S))) == without_times(codec.decode(expected))
    assert sum(meters[0].outcomes.values()) == 0
    assert meters[1].outcomes[Status.OK] == 3
    assert meters[1].outcomes[Status.BAD_REQUEST] == 1


def test_a_large_body_that_is_no_request_is_refused_by_the_worker(dispatcher: Dispatcher) -> None:
    reply = dispatcher.answer(b"\xff" * (LARGE_BODY_BYTES + 1), JSON)
    assert isinstance(reply, Future)
    assert json.loads(reply.result(LIMIT_S))["status"] == "bad_request"


def test_one_too_many_is_told_at_once_and_quick_ones_are_served(
    dispatcher: Dispatcher, worker: Worker, meters: tuple[Meter, Meter], solve_request: Callable[[int], SolveRequest]
) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def held() -> bytes:
        begun.set()
        assert go_on.wait(LIMIT_S)
        return b""

    worker.submit(held)
    assert begun.wait(LIMIT_S)
    reach = JSON.encode({**request_document(solve_request(41)), "mode": "reach"})
    waiting = dispatcher.answer(reach, JSON)
    assert isinstance(waiting, Future)
    for body, id in ((reach, 42), (JSON.encode({"mode": "reach", "id": -1}), 0), (b" " * (LARGE_BODY_BYTES + 1), 0)):
        refused = dispatcher.answer(body, JSON)
        assert isinstance(refused, bytes)
        reply = json.loads(refused)
        assert (reply["status"], reply["success"], reply["id"]) == ("overloaded", False, id)
        assert reply["error_msg"] == "1 long requests are waiting already; retry later"
    assert meters[0].outcomes[Status.OVERLOADED] == 3
    quick = dispatcher.answer(JSON.encode(request_document(solve_request(1))), JSON)
    assert isinstance(quick, bytes)
    assert json.loads(quick)["success"]
    go_on.set()
    assert json.loads(waiting.result(LIMIT_S))["success"]


def test_the_time_in_the_queue_counts(engine: Engine, worker: Worker, document: Callable[..., dict[str, Any]]) -> None:
    """`server_us` is from the request's bytes on, wherever it is answered."""
    now = 100.0

    def clock() -> float:
        return now

    services = [Service(engine.copy(), Meter("test"), clock) for _ in range(2)]
    dispatcher = Dispatcher(*services, worker, clock)
    begun, go_on = threading.Event(), threading.Event()
    worker.submit(lambda: (begun.set(), go_on.wait(LIMIT_S), b"")[2])
    assert begun.wait(LIMIT_S)
    reply = dispatcher.answer(JSON.encode(document(mode="reach")), JSON)
    assert isinstance(reply, Future)
    now = 103.0
    go_on.set()
    assert json.loads(reply.result(LIMIT_S))["server_us"] == pytest.approx(3e6)
