"""`QueryPump` with a channel made by hand: newest first, exactly one reply to every query, and its end."""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st
from service_fakes import StubSolver, service_with

from ik_proto import MAX_FRAME_BYTES, MSGPACK, Status
from ik_service.access import Doorkeeper
from ik_service.dispatcher import Dispatcher
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.query_pump import QueryPump
from ik_service.service import Service
from ik_service.worker import Worker

LIMIT_S = 10.0


class Query:
    """As much of a Zenoh query as the pump uses."""

    def __init__(self, body: bytes | None) -> None:
        self.payload = None if body is None else zenoh.ZBytes(body)
        self.replies: list[dict[str, Any]] = []
        self.dropped = threading.Event()

    def __enter__(self) -> "Query":
        return self

    def __exit__(self, *_: object) -> None:
        self.dropped.set()

    def reply(self, key: str, body: bytes) -> None:
        assert not self.dropped.is_set()
        self.replies.append(MSGPACK.decode(body))

    @property
    def answer(self) -> dict[str, Any]:
        """The only reply."""
        assert self.dropped.wait(LIMIT_S)
        (reply,) = self.replies
        return reply


class Channel:
    """A channel whose queries become visible together, when the test says."""

    def __init__(self, queries: list[Query]) -> None:
        self._changed = threading.Condition()
        self._queries = deque(queries)
        self._closed = False

    def recv(self) -> Query:
        with self._changed:
            assert self._changed.wait_for(lambda: self._queries or self._closed, LIMIT_S)
            if not self._queries:
                raise zenoh.ZError("closed")
            return self._queries.popleft()

    def try_recv(self) -> Query | None:
        with self._changed:
            if self._queries:
                return self._queries.popleft()
            if self._closed:
                raise zenoh.ZError("closed")
            return None

    def put(self, *queries: Query) -> None:
        with self._changed:
            self._queries += queries
            self._changed.notify()

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify()


@pytest.fixture
def worker() -> Iterator[Worker]:
    worker = Worker()
    yield worker
    assert worker.stop(LIMIT_S)


@pytest.fixture
def meter() -> Meter:
    return Meter("zenoh")


def pump_of(channel: Channel, dispatcher: Dispatcher) -> QueryPump:
    queries: Any = channel
    return QueryPump(queries, "ik/g1/rpc", dispatcher)


MakeDocument = Callable[..., dict[str, Any]]


def test_of_a_stream_that_piled_up_only_the_newest_is_solved(
    engine: Engine, worker: Worker, meter: Meter, document: MakeDocument
) -> None:
    """Hazard row: stale target."""
    service = service_with(engine, Status.OK, meter)
    queries = [Query(MSGPACK.encode(document(k, stream="arms"))) for k in range(20)]
    alone = [Query(MSGPACK.encode(document(k))) for k in range(3)]
    channel = Channel([alone[0], *queries[:10], alone[1], *queries[10:], alone[2]])
    pump = pump_of(channel, Dispatcher(service, service, worker))
    assert [query.answer["status"] for query in queries] == ["superseded"] * 19 + ["ok"]
    assert [query.answer["id"] for query in queries] == [k + 1 for k in range(20)]
    assert [query.answer["status"] for query in alone] == ["ok"] * 3
    channel.close()
    pump.finish(LIMIT_S)
    assert (meter.outcomes[Status.SUPERSEDED], meter.outcomes[Status.OK]) == (19, 4)


@settings(max_examples=25)
@given(
    kinds=st.lists(
        st.sampled_from(["plain", "a", "b", "reach", "reach a", "junk", "none", "huge", "late", "unauthorized"]),
        max_size=12,
    ),
    first=st.integers(0, 12),
)
def test_every_query_gets_exactly_one_answer(
    engine: Engine, document: MakeDocument, kinds: list[str], first: int
) -> None:
    """Hazard rows: slowloris / flood; malformed frame; oversized frame."""
    bodies: dict[str, bytes | None] = {
        "plain": MSGPACK.encode(document(token="right")),
        "a": MSGPACK.encode(document(token="right", stream="a")),
        "b": MSGPACK.encode(document(token="right", stream="b")),
        "reach": MSGPACK.encode(document(token="right", mode="reach")),
        "reach a": MSGPACK.encode(document(token="right", mode="reach", stream="a")),
        "late": MSGPACK.encode(document(token="right", budget_ms=1e-9)),
        "unauthorized": MSGPACK.encode(document(token="wrong", stream="a")),
        "junk": b"\xc1",
        "none": None,
        "huge": b"\x00" * (MAX_FRAME_BYTES + 1),
    }
    answers = {"late": "expired", "unauthorized": "unauthorized", "plain": "ok", "reach": "ok"}
    answers |= dict.fromkeys(("junk", "none", "huge"), "bad_request")
    worker, service = Worker(), service_with(engine, Status.OK)
    queries = [Query(bodies[kind]) for kind in kinds]
    channel = Channel(queries[:first])
    pump = pump_of(channel, Dispatcher(service, service, worker, doorkeeper=Doorkeeper(b"right", remembers=False)))
    channel.put(*queries[first:])
    for kind, query in zip(kinds, queries, strict=True):
        expected = [answers[kind]] if kind in answers else ["ok", "superseded"]
        assert query.answer["status"] in expected, kind
    for stream in ("a", "b"):
        of_it = [q for kind, q in zip(kinds, queries, strict=True) if kind in (stream, f"reach {stream}")]
        assert not of_it or of_it[-1].answer["status"] == "ok"
    channel.close()
    pump.finish(LIMIT_S)
    assert worker.stop(LIMIT_S)


def test_a_fault_of_ours_is_answered_and_the_thread_lives_on(
    engine: Engine,
    worker: Worker,
    document: MakeDocument,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    service = service_with(engine, Status.OK)
    dispatcher = Dispatcher(service, service, worker)
    answer = dispatcher.answer

    def faulty(body: bytes, *arguments: Any) -> Any:
        if body == b"fault":
            raise RuntimeError("a fault of ours")
        if body == b"late fault":
            failed: Future[bytes] = Future()
            failed.set_exception(RuntimeError("a fault of ours"))
            return failed
        return answer(body, *arguments)

    monkeypatch.setattr(dispatcher, "answer", faulty)
    queries = [Query(b"fault"), Query(b"late fault"), Query(MSGPACK.encode(document()))]
    channel = Channel(queries)
    pump = pump_of(channel, dispatcher)
    assert [query.answer["status"] for query in queries] == ["internal", "internal", "ok"]
    assert not any("fault of ours" in query.answer["error_msg"] for query in queries)
    assert caplog.text.count("RuntimeError: a fault of ours") == 2
    channel.close()
    pump.finish(LIMIT_S)


def test_at_the_end_what_takes_too_long_is_refused(
    engine: Engine, document: MakeDocument, monkeypatch: pytest.MonkeyPatch
) -> None:
    worker, begun, go_on = Worker(), threading.Event(), threading.Event()
    stub = StubSolver(Status.OK)
    solve = stub.solve

    def slow(*arguments: Any, **options: Any) -> Any:
        begun.set()
        assert go_on.wait(LIMIT_S)
        return solve(*arguments, **options)

    monkeypatch.setattr(stub, "solve", slow)
    solvers: dict[str, Any] = {"precise": stub}
    patient = Service(replace(engine, solvers=solvers), Meter("test"))
    dispatcher = Dispatcher(service_with(engine, Status.OK), patient, worker)
    queries = [Query(MSGPACK.encode(document(k, mode="reach"))) for k in range(2)]
    channel = Channel(queries)
    pump = pump_of(channel, dispatcher)
    assert begun.wait(LIMIT_S)
    channel.close()
    pump.finish(0.01)
    assert [query.answer["status"] for query in queries] == ["overloaded"] * 2
    go_on.set()
    assert worker.stop(LIMIT_S)
    assert [len(query.replies) for query in queries] == [1, 1]
