"""A loop's schedule: oversleeping does not add up, long gaps are not made up for."""

import pytest

from ik_client.pacer import MAX_BACKLOG, Pacer


class FakeTime:
    def __init__(self) -> None:
        self.now = 0.0

    def clock(self) -> float:
        return self.now

    def sleep(self, time: float) -> None:
        self.now += time + 0.001  # every sleep is too long


def test_oversleeping_does_not_add_up():
    time = FakeTime()
    pacer = Pacer(0.02, time.clock, time.sleep)
    for _ in range(101):
        pacer.wait()
    assert time.now == pytest.approx(100 * 0.02 + 0.001)
    assert (pacer.late, pacer.moved) == (0, 0)


def test_a_short_delay_is_made_up_for_and_a_long_one_is_not():
    time = FakeTime()
    pacer = Pacer(0.02, time.clock, time.sleep)
    pacer.wait()
    time.now += 0.045
    for _ in range(3):
        pacer.wait()
    assert time.now == pytest.approx(0.061)
    assert (pacer.late, pacer.moved) == (1, 0)
    time.now += 10.0
    pacer.wait()
    assert pacer.moved == 1
    assert pacer.behind == pytest.approx(10.0 - 0.02 + 0.001, abs=0.021)
    assert pacer.late == 2
    pacer.wait()
    assert time.now > 10.061 + MAX_BACKLOG / 3
