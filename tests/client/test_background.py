"""Calls in a thread of their own: waiting, results, giving up, and the end of the process."""

import contextlib
import subprocess
import sys
import threading
from collections.abc import Callable

import numpy as np
import pytest

from ik_client import IKClient, ServiceTimeout, ServiceUnavailable, transport_tcp
from ik_client.background import Background


def returning(event: threading.Event, value: str) -> Callable[[], str]:
    def call() -> str:
        event.wait(30.0)
        return value

    return call


def test_it_waits_only_so_long_and_gives_the_result_later():
    event = threading.Event()
    call = Background(returning(event, "done"))
    assert not call.wait(0.0)
    assert not call.wait(-1.0)
    event.set()
    assert call.wait(30.0)
    assert call.result() == "done"


def test_it_raises_what_the_call_raised():
    call = Background(lambda: 1 // 0)
    assert call.wait(30.0)
    with pytest.raises(ZeroDivisionError):
        call.result()


@pytest.mark.parametrize("ended", [False, True])
def test_what_comes_after_giving_up_is_discarded_properly(ended):
    event, discarded, arrived = threading.Event(), [], threading.Event()

    def discard(value: str) -> None:
        discarded.append(value)
        arrived.set()

    call = Background(returning(event, "late"))
    if ended:
        event.set()
        assert call.wait(30.0)
    call.abandon(discard)
    event.set()
    assert arrived.wait(30.0)
    assert discarded == ["late"]


def test_a_look_up_that_hangs_costs_the_timeout_and_its_result_is_used_later(monkeypatch, service, start_tcp):
    fake = start_tcp(service)
    answer, look_up, count = threading.Event(), transport_tcp._look_up, []

    def slow(host, port):
        count.append(host)
        answer.wait(30.0)
        return look_up(host, port)

    monkeypatch.setattr(transport_tcp, "_look_up", slow)
    with IKClient(f"tcp://localhost:{fake.port}", timeout=0.05, connect=False) as ik:
        for _ in range(3):
            with pytest.raises((ServiceTimeout, ServiceUnavailable)):  # the latter where it pauses between attempts
                ik.solve(np.eye(4), np.eye(4), np.zeros(14))
        assert count == ["localhost"]
        answer.set()
        ik.timeout = 30.0
        reply = None
        for _ in range(1000):
            with contextlib.suppress(ServiceUnavailable):
                reply = ik.solve(np.eye(4), np.eye(4), np.zeros(14))
                break
            threading.Event().wait(0.01)
        assert reply is not None
    assert count == ["localhost"]


def exit_status(exit_seconds: str) -> int:
    """Of a process that ends while Zenoh is trying to open sessions."""
    program = f"""
import zenoh
from ik_client import background, transport_zenoh
background._EXIT_SECONDS = {exit_seconds}
calls = [background.Background(lambda: zenoh.open(transport_zenoh.session_config("127.0.0.1:1"))) for _ in range(4)]
"""
    return subprocess.run([sys.executable, "-c", program], capture_output=True, check=False).returncode


def test_a_process_may_end_while_a_session_is_being_opened():
    assert [exit_status("30.0") for _ in range(3)] == [0, 0, 0]


def test_without_the_wait_such_a_process_is_aborted():
    """The negative control: native code that returns into a dying interpreter."""
    assert any(exit_status("0.0") != 0 for _ in range(20))
