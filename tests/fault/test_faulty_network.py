"""`IKClient` on a network that delays, drops, duplicates, reorders, truncates, stalls, splits and corrupts messages.

A call gives the answer to its very request, to the last bit, or raises an `IKError`; it never hangs; and once the
network is well again, calls are answered again.

Hazard rows: lost connection; replay / reorder (the client's side: a late or duplicated reply never answers another
request); malformed frame.
"""

import random
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from faults import Fault, Plan
from faulty_proxy import FaultyProxy
from faulty_transport import FaultyTransport
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_client import IKClient, IKError, ProtocolMismatch, ServiceTimeout
from ik_proto import SolveReply

TIMEOUT = 0.1
HANG_S = 5.0
"""A call that takes so long does not keep its time-out, however busy the machine."""
RECOVERY_S = 20.0
CALLS = 6

plans = st.lists(st.sampled_from(Fault), max_size=CALLS)
Known = list[tuple[tuple[np.ndarray, np.ndarray, np.ndarray], np.ndarray]]


@pytest.fixture(scope="module")
def known(service_process) -> Known:
    """Requests and what the service answers when nothing is in the way."""
    rng = np.random.default_rng(0)
    with IKClient(service_process.tcp_url, timeout=5.0) as ik:
        info = ik.info()
        middle, half = (info.lower + info.upper) / 2, (info.upper - info.lower) / 2
        asked = [middle + rng.uniform(-0.4, 0.4, len(middle)) * half for _ in range(CALLS)]
        wrists = [ik.fk(q + 0.05) for q in asked]
        requests = [(fk.left_wrist, fk.right_wrist, q) for fk, q in zip(wrists, asked, strict=True)]
        return [(request, _solution(ik.solve(*request))) for request in requests]


def _solution(reply: SolveReply) -> np.ndarray:
    assert reply.sol_q is not None
    return reply.sol_q


@pytest.fixture
def proxy(service_process) -> Iterator[FaultyProxy]:
    proxy = FaultyProxy(service_process.tcp)
    yield proxy
    proxy.stop()


def ask_all(ik: IKClient, known: Known) -> list[IKError]:
    """Ask everything once: right answers only, and none that takes for ever. Gives what was raised."""
    raised = []
    for request, truth in known:
        began = time.monotonic()
        try:
            np.testing.assert_array_equal(_solution(ik.solve(*request)), truth)
        except IKError as error:
            assert "\n" not in str(error)
            raised.append(error)
        assert time.monotonic() - began < HANG_S
    return raised


def recovers(ik: IKClient, known: Known) -> None:
    """Ask until an answer comes, then everything again with time to spare."""
    ik.timeout = 5.0
    end, pause = time.monotonic() + RECOVERY_S, threading.Event()
    while True:
        try:
            ik.fk(known[0][0][2])
            break
        except IKError:
            assert time.monotonic() < end, "the client does not recover"
            pause.wait(0.01)
    assert ask_all(ik, known) == []


@settings(max_examples=20)
@given(to_service=plans, to_client=plans)
def test_an_answer_is_to_the_very_request_or_there_is_none(service_process, known, to_service, to_client) -> None:
    proxy = FaultyProxy(service_process.tcp)
    try:
        with IKClient(proxy.url, timeout=TIMEOUT, connect=False) as ik:
            proxy.to_service, proxy.to_client = Plan(to_service), Plan(to_client)
            ask_all(ik, known)
            proxy.mend()
            recovers(ik, known)
    finally:
        proxy.stop()


def test_a_reply_that_comes_late_is_not_taken_for_another(proxy, known) -> None:
    """Hazard row: replay / reorder. The stale reply does arrive in place of the next: it is refused by its id."""
    with IKClient(proxy.url, timeout=5.0) as ik:
        proxy.to_client = Plan([Fault.LATE])
        ik.timeout = TIMEOUT
        with pytest.raises(ServiceTimeout):
            ik.solve(*known[0][0])
        ik.timeout = 5.0
        with pytest.raises(ProtocolMismatch, match="repl"):
            ik.solve(*known[1][0])
        assert ask_all(ik, known) == []


def test_a_reply_that_comes_twice_is_not_taken_for_another(proxy, known) -> None:
    """Hazard row: replay / reorder. Both copies come in one read, or the second in place of the next reply."""
    with IKClient(proxy.url, timeout=5.0) as ik:
        proxy.to_client = Plan([Fault.DUPLICATE])
        (error,) = ask_all(ik, known[:3])
        assert isinstance(error, ProtocolMismatch)
        assert ask_all(ik, known) == []


@pytest.mark.parametrize("fault", [Fault.SPLIT, Fault.DELAY])
@pytest.mark.parametrize("direction", ["to_service", "to_client"])
def test_what_only_comes_in_pieces_or_later_is_answered(proxy, known, fault, direction) -> None:
    with IKClient(proxy.url, timeout=5.0) as ik:
        setattr(proxy, direction, Plan([fault] * len(known)))
        assert ask_all(ik, known) == []
        assert proxy.accepted == 1


@pytest.mark.parametrize("fault", [Fault.TRUNCATE, Fault.RESET])
@pytest.mark.parametrize("direction", ["to_service", "to_client"])
def test_a_connection_that_breaks_once_is_replaced_within_the_call(proxy, known, fault, direction) -> None:
    """Hazard row: lost connection. Solving twice does no harm, so the caller need not know."""
    with IKClient(proxy.url, timeout=5.0) as ik:
        setattr(proxy, direction, Plan([fault]))
        assert ask_all(ik, known) == []
        assert proxy.accepted == 2


@pytest.mark.parametrize("fault", [Fault.DROP, Fault.STALL])
@pytest.mark.parametrize("direction", ["to_service", "to_client"])
def test_what_never_comes_is_a_time_out(proxy, known, fault, direction) -> None:
    with IKClient(proxy.url, timeout=5.0) as ik:
        setattr(proxy, direction, Plan([fault]))
        ik.timeout = TIMEOUT
        with pytest.raises(ServiceTimeout):
            ik.solve(*known[0][0])
        recovers(ik, known)


def test_a_corrupted_request_is_refused_and_a_corrupted_reply_is_noticed(proxy, known) -> None:
    """Hazard row: malformed frame."""
    with IKClient(proxy.url, timeout=5.0) as ik:
        proxy.to_service, proxy.to_client = Plan([Fault.CORRUPT]), Plan([Fault.PASS, Fault.CORRUPT])
        raised = ask_all(ik, known)
        assert [type(error).__name__ for error in raised] == ["BadRequest", "ProtocolMismatch"]


Wrap = Callable[[IKClient], FaultyTransport]


def wrap(ik: IKClient) -> FaultyTransport:
    assert ik._transport is not None
    ik._transport = faulty = FaultyTransport(ik._transport)
    return faulty


@pytest.fixture(scope="module", params=["tcp", "zenoh"])
def wrapped(request, service_process) -> Iterator[tuple[IKClient, FaultyTransport]]:
    if request.param == "zenoh":
        pytest.importorskip("zenoh")
    url = service_process.zenoh_url if request.param == "zenoh" else service_process.tcp_url
    with IKClient(url, timeout=5.0) as ik:
        yield ik, wrap(ik)


@settings(max_examples=20)
@given(to_service=plans, to_client=plans)
def test_the_same_holds_around_any_transport(wrapped, known, to_service, to_client) -> None:
    ik, faulty = wrapped
    faulty.to_service, faulty.to_client = Plan(to_service), Plan(to_client)
    ask_all(ik, known)
    faulty.mend()
    recovers(ik, known)


def test_a_plan_of_a_seed_is_the_same_again() -> None:
    first, second = (
        [plan.next() for _ in range(50)] for plan in (Plan.random(random.Random(5), 40, 0.5) for _ in "ab")
    )
    assert first == second
    assert set(first[40:]) == {Fault.PASS}
    assert set(first) > {Fault.PASS, Fault.DROP}
