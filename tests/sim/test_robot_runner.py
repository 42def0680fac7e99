"""A simulated robot that runs alone: its control ticks, its report, and that it always gives its arms back."""

from types import SimpleNamespace

import numpy as np
import pytest
from sim_fakes import FakeClock

from ik_client import Command
from ik_client.robot_end.guard import BUSY, RAMP
from ik_proto.robot_link import LinkState
from ik_proto.robots import RobotDescription
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.robot_runner import MAX_BACKLOG, RobotRunner


class FakeLink:
    """Brings what the test has sent, and keeps what is published."""

    def __init__(self, clock: FakeClock) -> None:
        self.states: list[LinkState] = []
        self.busy_states: list[LinkState] = []
        self.connection = SimpleNamespace(busy=False)
        self._clock = clock
        self._arrivals: list[SimpleNamespace] = []
        self._seq = 0

    def send(self, q: np.ndarray, *, session: str = "s", **fields) -> SimpleNamespace:
        self._seq += 1
        command = Command(q, np.zeros(len(q)), 0.0, session=session, seq=self._seq, **fields)
        arrival = SimpleNamespace(command=command, time=self._clock.now, connection=SimpleNamespace(busy=False))
        self._arrivals.append(arrival)
        return arrival

    def take(self) -> list[SimpleNamespace]:
        arrivals, self._arrivals = self._arrivals, []
        return arrivals

    def publish(self, state: LinkState, busy: LinkState) -> None:
        self.states.append(state)
        self.busy_states.append(busy)


class Rig:
    """A runner on a fake clock, and a loop that raises its arms."""

    def __init__(self, description: RobotDescription, ramp: float = RAMP) -> None:
        self.clock, self.lines = FakeClock(), []
        self.ramp = ramp
        self.robot = SimRobot(description, clock=self.clock, ramp=ramp)
        self.link = FakeLink(self.clock)
        self.runner = RobotRunner(
            self.robot,
            self.link,  # ty: ignore[invalid-argument-type]
            self.lines.append,
            clock=self.clock,
            sleep=self.clock.sleep,
            moved=lambda now: self.moved.append((now, self.robot.ticks)),
        )
        self.moved: list[tuple[float, int]] = []
        self.q = self.robot.read().q

    def live(self, ticks: int) -> None:
        """Take, engage, move, fall silent: the life of a robot, from tick to tick."""
        ready = round(self.ramp / CONTROL_PERIOD) + 3
        for k in range(ticks):
            q_set = self.robot.read().q_set
            if k < 2 or k > ready + 40:
                pass  # Nobody there yet, or no longer.
            elif k < ready:
                self.link.send(self.q if q_set is None else q_set)
            else:
                self.q = (q_set if k == ready and q_set is not None else self.q) + 0.02
                self.link.send(self.q, engaged=True)
            self.runner.tick()


def test_whoever_shows_the_robot_is_told_of_every_tick(toy: RobotDescription) -> None:
    """Also of those in which the arms are given back."""
    rig = Rig(toy, ramp=0.2)
    rig.live(30)
    rig.runner.release(rig.ramp)
    assert [ticks for _, ticks in rig.moved] == list(range(1, rig.robot.ticks + 1))
    assert rig.robot.ticks > 30
    assert np.diff([now for now, _ in rig.moved]) == pytest.approx(CONTROL_PERIOD)


PHASES = {"released": 1, "taking": 8, "ready": 13, "following": 30, "holding": 64, "ready again": 90}


@pytest.mark.parametrize("ticks", PHASES.values(), ids=PHASES)
def test_it_gives_the_arms_back_from_every_phase(toy: RobotDescription, ticks: int) -> None:
    """Hazard row "weight ramp / exit": asked to end at every phase, it ends with weight 0, in the time of the ramp."""
    rig = Rig(toy, ramp=0.2)
    rig.live(ticks)
    phase = next(name for name, at in PHASES.items() if at == ticks)
    assert rig.robot.guard.state == phase.split()[0]
    before, begin = rig.robot.guard.weight, rig.robot.time
    assert rig.runner.release(rig.ramp)
    assert rig.link.states[-1].weight == 0.0
    assert rig.link.states[-1].state == "released"
    assert rig.robot.time - begin == pytest.approx(before * rig.ramp, abs=1e-9)
    weights = [state.weight for state in rig.link.states]
    assert np.diff(weights).min() >= -CONTROL_PERIOD / rig.ramp - 1e-9


def test_giving_back_is_bounded_in_time(toy: RobotDescription) -> None:
    rig = Rig(toy, ramp=0.2)
    rig.live(14)
    rig.robot.guard._weight._duration = 1e9
    assert not rig.runner.release(rig.ramp)


def test_each_change_of_state_is_said_once(toy: RobotDescription) -> None:
    rig = Rig(toy, ramp=0.2)
    rig.live(100)
    said = [line.split("s  ", 1)[1] for line in rig.lines]
    assert said == [
        "taking",
        "ready",
        "following",
        "holding: no command for 0.1 s",
        "ready: no command for 0.5 s: engage again",
    ]


def test_the_report_tells_what_happened(toy: RobotDescription) -> None:
    rig = Rig(toy, ramp=0.2)
    rig.live(120)
    rig.link.send(np.full(4, np.nan))
    rig.runner.tick()
    rig.runner.release(rig.ramp)
    report = rig.runner.record.report(rig.robot, {"connections": 1})
    assert (report.takes, report.holds, report.disarms, report.releases) == (1, 1, 1, 1)
    assert report.dropped == {"busy": 0, "old": 0, "bad": 1}
    assert (report.state, report.weight) == ("released", 0.0)
    assert 0.02 <= report.largest_step <= 0.06
    assert report.largest_velocity == pytest.approx(report.largest_step / CONTROL_PERIOD)
    assert 0.0 < report.largest_acceleration <= 20.0 * (1 + 1e-5)
    assert report.largest_measured_step > 0.005
    assert report.step_while_disarmed < 1e-9
    assert report.seconds == pytest.approx(report.ticks * CONTROL_PERIOD)
    assert report.lowest_pelvis == pytest.approx(1.0)


def test_whoever_is_refused_is_told_that_it_is_busy(toy: RobotDescription) -> None:
    """Hazard row "two operators"."""
    rig = Rig(toy, ramp=0.2)
    rig.live(8)
    mine = rig.link.send(rig.q)
    yours = rig.link.send(rig.q, session="other")
    rig.runner.tick()
    assert (mine.connection.busy, yours.connection.busy) == (False, True)
    assert rig.link.busy_states[-1].note == BUSY
    assert rig.link.states[-1].note != BUSY


def test_ticks_keep_a_schedule_and_a_long_gap_is_not_made_up_for(toy: RobotDescription) -> None:
    rig = Rig(toy)
    rig.runner.run(lambda: True, duration=1.0)
    assert rig.robot.ticks == 50
    assert rig.clock.slept == pytest.approx(49 * CONTROL_PERIOD)
    rig.clock.now += 10.0 * MAX_BACKLOG
    before = rig.clock.now
    rig.runner.run(lambda: True, duration=1.0)
    assert rig.clock.now - before == pytest.approx(49 * CONTROL_PERIOD)


def test_it_stops_when_it_is_told_to(toy: RobotDescription) -> None:
    rig = Rig(toy)
    rig.runner.run(lambda: rig.robot.ticks < 7)
    assert rig.robot.ticks == 7
