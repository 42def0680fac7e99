"""`Dispatcher`: what is answered at once, what the worker gets, and that both are the same answers."""

import json
import math
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from service_fakes import StubSolver

from ik_proto import JSON, MSGPACK, Codec, SolveRequest, Status, request_document
from ik_service.access import Doorkeeper
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


class Held:
    """A job that keeps the worker busy until it is let go."""

    def __init__(self, worker: Worker) -> None:
        self.begun, self.go_on = threading.Event(), threading.Event()
        worker.submit(self)
        assert self.begun.wait(LIMIT_S)

    def __call__(self) -> bytes:
        self.begun.set()
        assert self.go_on.wait(LIMIT_S)
        return b""


@pytest.mark.parametrize("codec", [JSON, MSGPACK], ids=["json", "msgpack"])
def test_a_budget_runs_out_where_it_says_and_not_before(
    engine: Engine, worker: Worker, document: Callable[..., dict[str, Any]], codec: Codec
) -> None:
    """Hazard rows: stale target; loop overrun. What is too late is not solved."""
    now, meter = 100.0, Meter("test")
    services = [Service(engine.copy(), meter, lambda: now) for _ in range(2)]
    dispatcher = Dispatcher(services[0], services[1], worker, lambda: now)
    body = codec.encode(document(3, budget_ms=8.0))
    for waited_s, status in ((0.0, "ok"), (0.00799, "ok"), (0.00801, "expired"), (3600.0, "expired"), (-1.0, "ok")):
        reply = dispatcher.answer(body, codec, now - waited_s)
        assert isinstance(reply, bytes)
        got = codec.decode(reply)
        assert (got["status"], got["success"], got["id"]) == (status, status == "ok", 4)
        if status == "expired":
            q = got["sol_q"]
            assert (np.frombuffer(q).tolist() if isinstance(q, bytes) else q) == document(3)["q"]
            assert got["error_msg"]
    assert (meter.outcomes[Status.EXPIRED], meter.outcomes[Status.OK]) == (2, 3)
    late_and_wrong = codec.encode(document(3, budget_ms=8.0, q=[0.0]))
    wrong = dispatcher.answer(late_and_wrong, codec, now - 1.0)
    assert isinstance(wrong, bytes)
    assert codec.decode(wrong)["status"] == "bad_request"


def test_a_budget_runs_out_while_the_worker_is_busy(
    engine: Engine, worker: Worker, document: Callable[..., dict[str, Any]], openwbt_document: Callable[[int], Any]
) -> None:
    """Hazard row: loop overrun."""
    now, meter = 100.0, Meter("test")
    services = [Service(engine.copy(), meter, lambda: now) for _ in range(2)]
    dispatcher = Dispatcher(services[0], services[1], worker, lambda: now)
    for body in (
        JSON.encode(document(3, mode="reach", budget_ms=50.0)),
        JSON.encode(document(3, budget_ms=50.0)) + b" " * LARGE_BODY_BYTES,
    ):
        held = Held(worker)
        reply = dispatcher.answer(body, JSON)
        assert isinstance(reply, Future)
        now += 0.051
        held.go_on.set()
        assert json.loads(reply.result(LIMIT_S))["status"] == "expired"
    assert meter.outcomes[Status.EXPIRED] == 2


def test_a_newer_request_supersedes_what_waits_for_the_worker(
    engine: Engine, document: Callable[..., dict[str, Any]]
) -> None:
    """Hazard row: stale target."""
    worker, meter = Worker(), Meter("test")
    one, two = (Dispatcher(Service(engine, meter), Service(engine.copy(), Meter("test")), worker) for _ in range(2))

    def ask(dispatcher: Dispatcher, seed: int, **changes: Any) -> bytes | Future[bytes]:
        return dispatcher.answer(JSON.encode(document(seed, **changes)), JSON)

    held = Held(worker)
    old = ask(one, 1, mode="reach", stream="arms")
    others = [
        ask(two, 2, mode="reach", stream="arms"),  # another connection's
        ask(one, 3, mode="reach", stream="head"),
        ask(one, 4, mode="reach"),
    ]
    new = ask(one, 5, mode="reach", stream="arms")
    assert isinstance(old, Future)
    assert isinstance(new, Future)
    reply = json.loads(old.result(0.0))  # at once, while the worker is busy
    assert (reply["status"], reply["success"], reply["id"], reply["sol_q"]) == ("superseded", False, 2, None)
    quick = ask(one, 6, stream="arms")
    assert isinstance(quick, bytes)
    assert json.loads(quick)["status"] == "ok"
    assert json.loads(new.result(0.0))["status"] == "superseded"
    assert meter.outcomes[Status.SUPERSEDED] == 2
    held.go_on.set()
    for other in others:
        assert isinstance(other, Future)
        assert json.loads(other.result(LIMIT_S))["success"]
    assert worker.stop(LIMIT_S)


def test_streams_are_told_by_whoever_may_ask(
    engine: Engine, worker: Worker, document: Callable[..., dict[str, Any]]
) -> None:
    service = Service(engine, Meter("test"))

    def stream_of(body: bytes, codec: Codec = JSON, doorkeeper: Doorkeeper | None = None) -> str:
        return Dispatcher(service, service, worker, doorkeeper=doorkeeper).stream_of(body, codec)

    asked = document(stream="arms", token="right")
    assert stream_of(JSON.encode(asked)) == "arms"
    assert stream_of(MSGPACK.encode(asked), MSGPACK) == "arms"
    assert stream_of(json.dumps(asked).replace('"stream"', '"\\u0073tream"').encode()) == "arms"
    for body in (b"stream", JSON.encode(document()), JSON.encode(document(stream=7)), b'["stream"]'):
        assert stream_of(body) == ""
    assert stream_of(JSON.encode(asked) + b" " * LARGE_BODY_BYTES) == ""
    assert stream_of(JSON.encode(asked), doorkeeper=Doorkeeper(b"right", remembers=False)) == "arms"
    assert stream_of(JSON.encode(asked), doorkeeper=Doorkeeper(b"wrong", remembers=False)) == ""


def test_nothing_is_done_for_who_is_not_admitted(
    engine: Engine, worker: Worker, document: Callable[..., dict[str, Any]]
) -> None:
    """Hazard row: auth."""
    meter, stub = Meter("test"), StubSolver(Status.OK)
    service = Service(replace(engine, solvers={"precise": stub}), meter)
    dispatcher = Dispatcher(service, service, worker, doorkeeper=Doorkeeper(b"right", remembers=True))
    for k, (body, id) in enumerate(
        (
            (JSON.encode(document(8)), 9),
            (JSON.encode(document(8, token="wrong", mode="reach")), 9),
            (JSON.encode(document(8, token="right")) + b" " * LARGE_BODY_BYTES, 0),
        )
    ):
        reply = dispatcher.answer(body, JSON)
        assert isinstance(reply, bytes)
        got = json.loads(reply)
        assert (got["status"], got["success"], got["id"], got["sol_q"]) == ("unauthorized", False, id, None)
        assert "right" not in got["error_msg"]
        assert dispatcher.hopeless == k + 1
    assert stub.asked == {}
    assert meter.outcomes[Status.UNAUTHORIZED] == 3
    for changes in ({"token": "right"}, {}):
        reply = dispatcher.answer(JSON.encode(document(8, **changes)), JSON)
        assert isinstance(reply, bytes)
        assert json.loads(reply)["status"] == "ok"
    assert dispatcher.hopeless == 0


def test_only_what_cannot_be_decoded_is_hopeless(
    dispatcher: Dispatcher, document: Callable[..., dict[str, Any]], openwbt_document: Callable[[int], dict[str, Any]]
) -> None:
    """Hazard row: malformed frame. A client's mistakes, OpenWBT's for one, never cost it its connection."""
    wrong = [{**openwbt_document(1), "left_wrist": [[math.nan] * 4] * 4}, document(q=[1.0]), {"verb": "dance"}, {}]
    for _ in range(20):
        for request in wrong:
            dispatcher.answer(json.dumps(request).encode(), JSON)
    assert dispatcher.hopeless == 0
    for k in range(20):
        dispatcher.answer(b"\x00" * k, JSON)
    assert dispatcher.hopeless == 20
    reply = dispatcher.answer(b"\xff" * (LARGE_BODY_BYTES + 1), JSON)
    assert isinstance(reply, Future)
    reply.result(LIMIT_S)
    assert dispatcher.hopeless == 21


def test_the_time_in_the_queue_counts(engine: Engine, worker: Worker, document: Callable[..., dict[str, Any]]) -> None:
    """`server_us` is from the request's bytes on, wherever it is answered."""
    now = 100.0

    def clock() -> float:
        return now

    services = [Service(engine.copy(), Meter("test"), clock) for _ in range(2)]
    dispatcher = Dispatcher(services[0], services[1], worker, clock)
    begun, go_on = threading.Event(), threading.Event()
    worker.submit(lambda: (begun.set(), go_on.wait(LIMIT_S), b"")[2])
    assert begun.wait(LIMIT_S)
    reply = dispatcher.answer(JSON.encode(document(mode="reach")), JSON)
    assert isinstance(reply, Future)
    now = 103.0
    go_on.set()
    assert json.loads(reply.result(LIMIT_S))["server_us"] == pytest.approx(3e6)
