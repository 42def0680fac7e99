"""The load generator on a clock of its own: what is due when, what counts, and what a frozen service looks like."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_client import BadRequest, ServiceTimeout, ServiceUnavailable
from ik_client.load.generator import Generator, Schedule
from ik_client.load.outcomes import Durations, Outcomes
from ik_client.load.workloads import Workload
from ik_proto import SolveReply, Status

N = 14
URL = "tcp://127.0.0.1:1"


class World:
    """A clock, a sleep that is exact, and a service whose answers take as long as they are told to."""

    def __init__(self, takes=lambda now: 0.001, says=lambda k: Status.OK) -> None:
        self.now = 100.0
        self.takes = takes
        self.says = says
        self.sent: list[float] = []
        self.seeds: list[np.ndarray] = []
        self.options: list[dict] = []
        self.asks: dict = {}

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def solve(self, left_wrist, right_wrist, q, dq, **options) -> SolveReply:
        k = len(self.sent)
        self.options.append(options)
        self.sent.append(self.now)
        self.seeds.append(q)
        self.now += self.takes(self.now)
        said = self.says(k)
        if isinstance(said, Exception):
            raise said
        return SolveReply(success=said.success, error="", status=said, sol_q=np.full(N, float(k)), solve_us=8.0)

    def run(self, rate=200.0, duration=10.0, warmup=0.0, stopped=lambda: False, chained=True, **options) -> Outcomes:
        frames = np.tile(np.eye(4), (7, 1, 1))
        workload = Workload("test", frames, frames, np.arange(7.0)[:, None] * np.ones(N), chained=chained)
        begin = self.now
        schedule = Schedule(
            begin, begin + warmup, begin + warmup + duration, 1.0 / rate if rate else 0.0, grace=1.0, **options
        )
        generator = Generator(
            self, workload, schedule, good_within=0.02, stopped=stopped, clock=self.clock, sleep=self.sleep, **self.asks
        )
        return generator.run()


def freezing(now: float) -> float:
    """1 ms, but frozen for the first 200 ms of every 2 s."""
    phase = (now - 100.0) % 2.0
    return 0.001 if phase >= 0.2 else 0.201 - phase


def test_open_loop_shows_a_freeze_that_closed_loop_hides():
    """Coordinated omission. With 200 ms in 2 s a tenth of all requests waits, evenly 0 to 200 ms: p95 is about 100."""
    opened = World(freezing).run()
    assert opened.total == 2000
    assert 0.090 < opened.latency.percentile(95.0) < 0.150
    assert 0.170 < opened.latency.percentile(99.0) < 0.202
    closed = World(freezing).run(closed=True)
    assert closed.latency.percentile(99.0) < 0.002
    assert closed.latency.percentile(100.0) == pytest.approx(0.2, abs=0.002)
    # The time from sending to answer hides it in both: that is why latency counts from when a request was due.
    assert opened.round_trip.percentile(99.0) < 0.002


def test_requests_are_due_at_a_constant_rate_whatever_the_answers():
    world = World(lambda now: 0.0005)
    world.run(rate=100.0, duration=1.0)
    np.testing.assert_allclose(np.array(world.sent) - 100.0, np.arange(100) * 0.01, atol=1e-9)


def test_in_a_closed_loop_a_request_waits_for_the_answer_before():
    world = World(lambda now: 0.03)
    outcomes = world.run(rate=100.0, duration=1.0, closed=True)
    np.testing.assert_allclose(np.diff(world.sent), 0.03)
    assert outcomes.latency.percentile(100.0) == pytest.approx(0.03, rel=1e-3)
    world = World(lambda now: 0.03)
    world.run(rate=None, duration=1.0, closed=True)
    np.testing.assert_allclose(np.diff(world.sent), 0.03)


def test_outcomes_are_counted_by_what_they_are():
    said = [
        Status.OK,
        Status.UNREACHABLE,
        Status.NOT_CONVERGED,
        ServiceTimeout(URL, 0.1),
        ServiceUnavailable(URL, "nobody is there"),
        BadRequest(Status.UNSUPPORTED, "no such preset"),
        Status.OK,
        Status.OK,
    ]
    takes = {3: 0.1, 7: 0.03}
    world = World()
    world.takes = lambda now: takes.get(len(world.sent) - 1, 0.001)
    world.says = lambda k: said[k]
    outcomes = world.run(rate=5.0, duration=1.6)
    assert outcomes.statuses == {"ok": 3, "unreachable": 1, "not_converged": 1}
    assert outcomes.errors == {"ServiceUnavailable": 1, "unsupported": 1}
    assert (outcomes.timeouts, outcomes.unsent) == (1, 0)
    assert (outcomes.answered, outcomes.failed, outcomes.total) == (5, 3, 8)
    assert outcomes.good == 3  # not the one that did not converge, nor the one that took 30 ms of 20
    assert outcomes.latency.count == 6  # answers and the timeout
    assert outcomes.latency.percentile(100.0) == pytest.approx(0.1, rel=1e-3)
    assert outcomes.solve.count == 5
    assert outcomes.solve.percentile(50.0) == pytest.approx(8e-6, rel=1e-2)


def test_a_service_that_cannot_keep_up_leaves_requests_unsent_and_they_count():
    outcomes = World(lambda now: 0.1).run(rate=100.0, duration=2.0)
    assert outcomes.total == 200
    assert outcomes.answered == pytest.approx(30, abs=1)  # 2 s, and 1 s of grace, at 10 a second
    assert outcomes.unsent == 200 - outcomes.answered
    assert outcomes.latency.count == 200
    assert outcomes.latency.percentile(50.0) > 1.0


def test_the_generators_own_lateness_is_not_the_services():
    slow_service = World(lambda now: 0.02)
    assert slow_service.run(rate=100.0, duration=1.0).lateness.percentile(100.0) < 1e-6
    slow_sleep = World()
    slow_sleep.sleep = lambda seconds: setattr(slow_sleep, "now", slow_sleep.now + seconds + 0.004)
    late = slow_sleep.run(rate=100.0, duration=1.0)
    assert late.lateness.percentile(50.0) == pytest.approx(0.004, rel=1e-2)
    assert late.latency.percentile(50.0) == pytest.approx(0.005, rel=1e-2)


def test_warm_up_does_not_count():
    world = World(lambda now: 0.5 if now < 100.9 else 0.001)
    outcomes = world.run(rate=2.0, warmup=1.0, duration=3.0)
    assert len(world.sent) == 8
    assert outcomes.total == 6
    assert outcomes.latency.percentile(100.0) < 0.002


def test_a_stop_ends_it_soon_and_keeps_what_there_is():
    world = World()
    outcomes = world.run(rate=1.0, duration=1000.0, stopped=lambda: world.now > 103.5)
    assert outcomes.total == 4
    assert world.now < 103.8


def test_mode_and_collision_go_with_every_request():
    world = World()
    world.run(rate=10.0, duration=0.3)
    assert world.options == [{"mode": None, "collision": None}] * 3
    world = World()
    world.asks = {"mode": "reach", "collision": "off"}
    world.run(rate=10.0, duration=0.3)
    assert world.options == [world.asks] * 3


def test_a_chained_solve_starts_from_the_last_solution_that_may_be_followed():
    world = World(says=lambda k: Status.NOT_CONVERGED if k == 2 else Status.OK)
    world.run(rate=10.0, duration=0.5)
    assert [seed[0] for seed in world.seeds] == [0.0, 0.0, 1.0, 1.0, 3.0]
    world = World()
    world.run(rate=10.0, duration=0.5, chained=False)
    assert [seed[0] for seed in world.seeds] == [0.0, 1.0, 2.0, 3.0, 4.0]


@settings(max_examples=20)
@given(st.lists(st.floats(2e-7, 500.0), min_size=1, max_size=100))
def test_percentiles_are_those_of_the_sorted_values_to_three_digits(seconds):
    durations = Durations()
    for value in seconds:
        durations.record(value)
    for percent in (50.0, 90.0, 99.0):
        # Definitions of a percentile differ by which neighbour they take where the rank is not whole.
        lower, upper = (np.percentile(seconds, percent, method=method) for method in ("lower", "higher"))
        below = max([value for value in seconds if value < lower], default=lower)
        assert below * (1.0 - 1e-3) - 1e-9 <= durations.percentile(percent) <= upper * (1.0 + 1e-3) + 1e-9
    assert durations.percentile(100.0) == pytest.approx(max(seconds), rel=1e-3, abs=1e-9)
    assert durations.summary()["count"] == len(seconds)


def test_durations_out_of_range_are_kept_at_its_ends():
    durations = Durations()
    for value in (0.0, -1.0, 1e9):
        durations.record(value)
    assert durations.count == 3
    assert durations.percentile(100.0) == pytest.approx(600.0, rel=1e-3)
    assert Durations().percentile(99.0) == 0.0


def test_outcomes_of_several_clients_add_up():
    total = Outcomes()
    for _ in range(3):
        total.add(World().run(rate=10.0, duration=1.0))
    assert total.total == 30
    assert total.latency.count == 30
