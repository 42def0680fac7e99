"""`Worker`: order, a bounded number of jobs that wait, cancelling, faults, and its end."""

import threading
from collections.abc import Iterator

import pytest

from ik_service.worker import Busy, Stream, Worker

LIMIT_S = 10.0


class Gate:
    """A job that is done when the test says so."""

    def __init__(self) -> None:
        self.begun, self.open = threading.Event(), threading.Event()

    def __call__(self) -> bytes:
        self.begun.set()
        assert self.open.wait(LIMIT_S)
        return b"gate"


@pytest.fixture
def gate() -> Iterator[Gate]:
    gate = Gate()
    yield gate
    gate.open.set()


@pytest.fixture
def worker(gate: Gate) -> Iterator[Worker]:
    worker = Worker(waiting=2)
    yield worker
    gate.open.set()
    assert worker.stop(LIMIT_S)


def test_jobs_are_done_in_order_in_one_thread_of_its_own(worker: Worker) -> None:
    names: list[str] = []

    def job(k: int) -> bytes:
        names.append(threading.current_thread().name)
        return str(k).encode()

    assert [worker.submit(lambda k=k: job(k)).result(LIMIT_S) for k in range(10)] == [b"%d" % k for k in range(10)]
    assert set(names) == {"worker"}


def test_one_too_many_is_refused_and_the_others_are_done(worker: Worker, gate: Gate) -> None:
    running = worker.submit(gate)
    assert gate.begun.wait(LIMIT_S)
    waiting = [worker.submit(lambda: b"done") for _ in range(2)]
    with pytest.raises(Busy, match="2 long requests are waiting already") as caught:
        worker.submit(lambda: b"too many")
    assert caught.value.waiting == 2
    gate.open.set()
    assert running.result(LIMIT_S) == b"gate"
    assert [job.result(LIMIT_S) for job in waiting] == [b"done", b"done"]
    assert worker.submit(lambda: b"room again").result(LIMIT_S) == b"room again"


def test_a_cancelled_job_leaves_its_place_to_another(worker: Worker, gate: Gate) -> None:
    running = worker.submit(gate)
    assert gate.begun.wait(LIMIT_S)
    done: list[str] = []
    cancelled, kept = worker.submit(lambda: done.append("cancelled") or b""), worker.submit(lambda: b"kept")
    assert cancelled.cancel()
    another = worker.submit(lambda: b"another")
    assert not running.cancel()
    gate.open.set()
    assert (kept.result(LIMIT_S), another.result(LIMIT_S)) == (b"kept", b"another")
    assert done == []


def test_what_waits_of_a_stream_is_superseded_at_once(worker: Worker, gate: Gate) -> None:
    """Hazard row: stale target."""
    running = worker.submit(gate, Stream("a", lambda: b"superseded"))
    assert gate.begun.wait(LIMIT_S)
    old = worker.submit(lambda: b"old", Stream("a", lambda: b"superseded"))
    other = worker.submit(lambda: b"other", Stream("b", lambda: b"superseded"))
    worker.supersede("a")
    assert old.result(0.0) == b"superseded"
    new = worker.submit(lambda: b"new", Stream("a", lambda: b"superseded"))  # into the place that has become free
    gate.open.set()
    assert [job.result(LIMIT_S) for job in (running, other, new)] == [b"gate", b"other", b"new"]


def test_a_job_that_raises_does_not_take_the_thread_along(worker: Worker) -> None:
    def fail() -> bytes:
        raise RuntimeError("fault")

    assert isinstance(worker.submit(fail).exception(LIMIT_S), RuntimeError)
    assert worker.submit(lambda: b"alive").result(LIMIT_S) == b"alive"


def test_stop_drops_what_waits_and_says_whether_the_rest_is_done(worker: Worker, gate: Gate) -> None:
    running = worker.submit(gate)
    assert gate.begun.wait(LIMIT_S)
    waiting = worker.submit(lambda: b"never")
    assert not worker.stop(0.0)
    assert waiting.cancelled()
    with pytest.raises(Busy):
        worker.submit(lambda: b"too late")
    gate.open.set()
    assert worker.stop(LIMIT_S)
    assert running.result(LIMIT_S) == b"gate"


def test_without_jobs_there_is_no_thread() -> None:
    before = threading.active_count()
    assert Worker().stop(0.0)
    assert threading.active_count() == before
