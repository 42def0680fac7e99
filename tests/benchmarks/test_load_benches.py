"""The soak and the test with bad clients: what they count, what they conclude, and that the commands run."""

import json
import math
import os
import socket
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import bad_clients, soak
from benchmarks.load.drift import drift
from benchmarks.load.fleet import Fleet
from benchmarks.load.proc import Sample, sample
from ik_client.load.generator import Schedule
from ik_client.load.outcomes import Outcomes
from ik_proto import FrameDecoder, encode_frame

REQUEST = encode_frame(b"{}")
REPLY = encode_frame(b'{"status": "ok", "success": true, "solve_us": 10.0}')


# Trends.


@given(
    st.lists(st.floats(-100.0, 100.0), min_size=3, max_size=25, unique=True),
    st.integers(0, 2**32 - 1),
)
def test_the_interval_is_that_of_kendalls_test(values: list[float], seed: int) -> None:
    times = np.cumsum(np.random.default_rng(seed).uniform(0.5, 2.0, len(values)))
    found = drift(times, np.array(values))
    n = len(values)
    critical = 1.959963984540054 * math.sqrt(n * (n - 1) * (2 * n + 5) / 18.0)

    def kendall(slope: float) -> float:
        left = np.array(values) - slope * times
        return abs(sum(np.sign(left[j] - left[i]) for i in range(n) for j in range(i + 1, n)))

    assert found.low <= found.slope <= found.high
    # What the test does not reject lies within, up to the rounding of the interval's ends to one pair.
    width = min(found.high - found.low, 1e6)
    for inside in (found.low + 1e-6 * width, found.high - 1e-6 * width):
        if math.isfinite(inside):
            assert kendall(inside) <= critical + 4
    for outside in (found.low - 1e-6 * (1.0 + width), found.high + 1e-6 * (1.0 + width)):
        if math.isfinite(outside):
            assert kendall(outside) >= critical - 4


def test_scatter_is_no_drift_and_a_rise_is() -> None:
    rng, times = np.random.default_rng(1), np.arange(5.0, 545.0, 10.0)
    series = [3.0 + rng.exponential(1.0, len(times)) for _ in range(300)]
    assert sum(drift(times, values).beyond_noise for values in series) <= 0.05 * len(series)
    rising = [values + 4.0 * times / times[-1] for values in series]
    assert all(drift(times, values).beyond_noise for values in rising)
    falling = [values - 4.0 * times / times[-1] for values in series]
    assert not any(drift(times, values).beyond_noise for values in falling)


def test_a_rise_smaller_than_the_spread_is_noise_and_one_bad_window_moves_nothing() -> None:
    times = np.arange(60.0)
    spread = 3.0 + np.where(times % 2, 1.0, -1.0)
    small = drift(times, spread + 0.01 * times)
    assert small.change == pytest.approx(0.59, rel=0.2)
    assert not small.beyond_noise
    line = 3.0 + 0.1 * times
    line[-1] = 1e6
    assert drift(times, line).slope == pytest.approx(0.1)


# The fleet.


@contextmanager
def server(serve: Callable[[socket.socket, int], bool]) -> Generator[tuple[str, int]]:
    """Answers every connection's requests in a thread of its own.

    `serve` gets the connection and the number of its request, and says whether to keep the connection.
    """
    listener = socket.create_server(("127.0.0.1", 0))
    threads: list[threading.Thread] = []

    def talk(connection: socket.socket) -> None:
        decoder, k = FrameDecoder(), 0
        with connection:
            while data := connection.recv(4096):
                for _ in decoder.feed(data):
                    k += 1
                    if not serve(connection, k):
                        return

    def accept() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            threads.append(threading.Thread(target=talk, args=(connection,)))
            threads[-1].start()

    accepting = threading.Thread(target=accept)
    accepting.start()
    try:
        yield listener.getsockname()
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        accepting.join()
        for thread in threads:
            thread.join()


def load(address: tuple[str, int], clients: int = 2, seconds: float = 0.4, timeout: float = 1.0) -> Outcomes:
    fleet = Fleet(address, [REQUEST], clients, timeout=timeout)
    begin = time.monotonic()
    try:
        (outcomes,) = fleet.run(Schedule(begin, begin, begin + seconds, 0.02, grace=0.2))
    finally:
        fleet.close()
    return outcomes


def test_a_freeze_is_charged_to_every_request_that_had_to_wait() -> None:
    frozen = threading.Event()

    def serve(connection: socket.socket, k: int) -> bool:
        if k == 5 and not frozen.is_set():
            frozen.set()
            time.sleep(0.3)
        connection.sendall(REPLY)
        return True

    with server(serve) as address:
        outcomes = load(address, clients=1, seconds=1.0)
    assert outcomes.statuses == {"ok": outcomes.total}
    assert outcomes.total == 50
    # Fifteen were due in the freeze; nine or ten of them had 0.1 s or more of it before them.
    assert outcomes.latency.percentile(100.0 * (1.0 - 9.0 / 50.0)) >= 0.1


def test_a_connection_that_breaks_costs_the_request_on_the_way_and_no_other() -> None:
    def serve(connection: socket.socket, k: int) -> bool:
        if k < 4:
            connection.sendall(REPLY)
        return k < 4

    with server(serve) as address:
        outcomes = load(address)
    assert outcomes.total == 40
    assert outcomes.errors.total() == 10
    assert outcomes.answered == 30


def test_requests_nobody_answers_are_all_accounted_for() -> None:
    with server(lambda connection, k: True) as address:
        outcomes = load(address, timeout=0.1)
    assert outcomes.total == 40
    assert outcomes.answered == 0
    assert outcomes.timeouts > 0
    assert outcomes.latency.count == 40
    assert outcomes.latency.percentile(100.0) >= 0.1


# What a soak concludes.


def soaked(rss: np.ndarray, p99_ms: np.ndarray, descriptors: int = 30) -> soak.Soak:
    windows = []
    for ms in p99_ms:
        windows.append(Outcomes())
        windows[-1].latency.record(1e-3 * ms)
        windows[-1].statuses["ok"] += 1
    samples = [Sample(mb, mb, 5, 30, 0.0) for mb in rss]
    samples[-1] = Sample(rss[-1], rss[-1], 5, descriptors, 0.0)
    times = np.linspace(0.0, 10.0 * len(p99_ms), len(rss)).tolist()
    return soak.Soak("c", 1000.0, 0.0, 10.0, times, samples, windows)


def missed(found: soak.Soak) -> list[str]:
    return [verdict.what for verdict in soak.verdicts(found) if not verdict.met]


def test_a_soak_fails_for_growth_drift_and_what_is_left_open() -> None:
    rng = np.random.default_rng(2)
    flat, steady = np.full(100, 140.0), rng.normal(3.0, 0.2, 60)
    assert missed(soaked(flat, steady)) == []
    assert missed(soaked(np.linspace(140.0, 144.9, 100), steady)) == []
    assert missed(soaked(np.linspace(140.0, 145.1, 100), steady)) == ["growth of resident memory"]
    assert missed(soaked(flat, steady + np.linspace(0.0, 1.0, 60))) == ["p99 from begin to end"]
    assert missed(soaked(flat, steady, descriptors=31)) == ["more descriptors at the end"]
    lost = soaked(flat, steady)
    lost.windows[7].timeouts += 1
    assert missed(lost) == ["requests without an answer"]


def test_a_process_is_looked_at() -> None:
    with socket.socket():
        more = sample(os.getpid())
    less = sample(os.getpid())
    assert more.descriptors == less.descriptors + 1
    assert more.threads >= 1
    assert more.cpu_s > 0.0
    assert more.rss_mb >= more.pss_mb > 1.0


# The commands.


@pytest.fixture
def compiled(kernel_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IK_CACHE_DIR", str(kernel_cache))


@pytest.mark.usefixtures("compiled")
def test_a_short_soak_saves_its_numbers(tmp_path: Path) -> None:
    saved = tmp_path / "soak.json"
    code = soak.main(["--seconds", "2", "--rate", "200", "--json", str(saved)])
    numbers = json.loads(saved.read_text())
    assert code == (0 if all(verdict["met"] for verdict in numbers["verdicts"]) else 1)
    assert sum(window["due"] for window in numbers["windows"]) == 360
    assert len(numbers["windows"]) == soak.LEAST_WINDOWS
    assert len(numbers["samples"]) >= 10


@pytest.mark.usefixtures("compiled")
def test_bad_clients_of_every_kind_have_their_turn(tmp_path: Path) -> None:
    """Hazard row: slowloris / flood. That good clients keep their p99 is measured, not asserted here."""
    saved = tmp_path / "bad.json"
    code = bad_clients.main(["--clients", "8", "--rounds", "1", "--seconds", "0.5", "--json", str(saved)])
    numbers = json.loads(saved.read_text())
    assert code == (0 if all(verdict["met"] for verdict in numbers["verdicts"]) else 1)
    assert numbers["alone"]["total"]["due"] == numbers["among"]["total"]["due"] == 100
    assert numbers["alone"]["bad_clients"] == {}
    deeds = numbers["among"]["bad_clients"]
    assert set(deeds) == {"slow readers", "slow writers", "junk senders", "floods"}
    assert all(done["connections"] >= 1 and done["bytes sent"] >= 1 for done in deeds.values())
    assert deeds["floods"]["bytes sent"] > 1000 * deeds["slow writers"]["bytes sent"]
