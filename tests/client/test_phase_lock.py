"""A fast loop in step with a slower robot."""

import numpy as np
import pytest

from ik_client.pacer import Pacer
from ik_client.phase_lock import BEFORE, PhaseLock


class World:
    """Time that passes by waiting; a robot whose states arrive now and then."""

    def __init__(self, period: float, robot_period: float, begin: float, drift: float = 0.0, scatter: float = 0.0):
        self.now = 100.0
        self.pacer = Pacer(period, lambda: self.now, self.sleep)
        self.lock = PhaseLock(self.pacer, period, robot_period)
        rng = np.random.default_rng(0)
        times = 100.0 + begin + robot_period * (1.0 + drift) * np.arange(4000)
        self.arrivals = times + scatter * rng.uniform(-1.0, 1.0, len(times))

    def sleep(self, time: float) -> None:
        self.now += time

    def run(self, ticks: int) -> np.ndarray:
        """How long before a tick each state arrived [s]."""
        gaps, seen = [], 0
        for _ in range(ticks):
            self.pacer.wait()
            arrived = int(np.searchsorted(self.arrivals, self.now, side="right"))
            if arrived > seen:
                gaps.append(self.now - self.arrivals[arrived - 1])
            seen = arrived
            if arrived:
                self.lock.follow(self.arrivals[arrived - 1])
        return np.array(gaps)


@pytest.mark.parametrize("begin", np.linspace(0.0, 0.005, 6))
@pytest.mark.parametrize("drift", [0.0, 1e-4, -1e-4])
def test_a_tick_comes_to_begin_when_a_state_has_just_arrived(begin, drift):
    gaps = World(0.005, 0.02, begin, drift).run(4000)
    assert np.abs(gaps[500:] - BEFORE).max() < 1e-4


def test_without_it_the_schedules_drift_past_each_other():
    world = World(0.005, 0.02, 0.001, 1e-3)
    world.lock = PhaseLock(world.pacer, 0.005, 0.021)  # no multiple: it does nothing
    gaps = world.run(4000)
    assert float(np.ptp(gaps[500:])) > 0.004


def test_arrivals_that_scatter_move_the_schedule_hardly():
    world = World(0.005, 0.02, 0.0, scatter=0.4e-3)
    world.run(2000)
    due = []
    for _ in range(400):
        world.run(1)
        due.append(world.pacer.due)
    assert np.abs(np.diff(np.array(due)) - 0.005).max() < 1e-4
