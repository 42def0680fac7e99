"""Keeping time, with a clock that is moved by hand: no test here depends on the machine."""

from collections.abc import Callable

import numpy as np
import pytest
from sim_fakes import FakeClock, FakeSolver, SteadyHands, steps_to

from ik_client import ArmState, Command, LoopState, ServiceTimeout, StepLimiter, TeleopLoop, TickReport
from ik_proto.robots import RobotDescription
from sim_client.realtime import MAX_BACKLOG, Runner
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.sources import scripted_arm
from sim_client.target_display import TargetDisplay
from sim_client.trace import Tick, Trace


class Bench:
    """A loop and a toy robot on one fake clock, engaged."""

    def __init__(self, description: RobotDescription, takes: float = 0.001) -> None:
        self.clock = FakeClock()
        self.robot = SimRobot(description, clock=self.clock, ramp=CONTROL_PERIOD)
        self.solver = FakeSolver(self.clock, takes=0.0)
        self.trace = Trace()
        self.loop = TeleopLoop(
            self.solver,
            SteadyHands(*self.robot.wrists(), ready=lambda: self.robot.read().ready),
            self.robot,
            StepLimiter(0.04),
            arms=(scripted_arm(), scripted_arm()),
            clock=self.clock,
        )
        while self.loop.states != (ArmState.ACTIVE, ArmState.ACTIVE):
            assert self.robot.ticks < 20
            self.loop.tick()
            self.robot.advance()
            self.clock.now += CONTROL_PERIOD
        self.robot.ticks = self.robot.ticks_without_command = 0
        self.solver.takes = takes
        self.runner = self.runner_with()

    def runner_with(self, *observers: "Spy") -> Runner:
        return Runner(self.loop, self.robot, [self.trace, *observers], clock=self.clock, sleep=self.clock.sleep)


class Spy:
    """Observer that does something at every tick."""

    def __init__(self, act: Callable[[Tick], None]) -> None:
        self.act = act

    def observe(self, tick: Tick) -> None:
        self.act(tick)


@pytest.fixture
def bench(toy: RobotDescription) -> Bench:
    return Bench(toy)


def test_runs_in_real_time(bench: Bench) -> None:
    pace = bench.runner.run(2.0)
    assert pace.ticks == len(bench.trace) == bench.robot.ticks == 100
    assert pace.simulated == pytest.approx(2.0)
    assert pace.late_ticks == pace.moved == 0
    assert pace.real_time_factor >= 1.0
    assert pace.real_time_factor == pytest.approx(1.0, rel=0.02)
    assert pace.headroom == pytest.approx(CONTROL_PERIOD / 0.001)
    assert bench.clock.slept == pytest.approx(99 * (CONTROL_PERIOD - 0.001))
    assert bench.robot.ticks_without_command == 0


def test_a_loop_that_does_not_send_is_counted(bench: Bench) -> None:
    """Negative control: the count is the robot's, not an assumption."""
    real = bench.robot.send
    calls = []

    def lossy(command) -> None:
        calls.append(command)
        if len(calls) % 10:
            real(command)

    bench.robot.send = lossy
    bench.runner.run(1.0)
    assert bench.robot.ticks_without_command == 5


def test_a_hung_service_never_stops_the_physics(toy: RobotDescription) -> None:
    """Every solve takes its whole timeout and fails: ticks are on time all the same, and the robot holds."""
    bench = Bench(toy, takes=0.010)
    bench.solver.fault = ServiceTimeout("tcp://x", 0.010)
    begin = bench.robot.time
    pace = bench.runner.run(1.0)
    assert pace.late_ticks == 0
    assert pace.real_time_factor >= 1.0
    assert bench.robot.time - begin == pytest.approx(1.0)
    assert bench.robot.ticks_without_command == 0
    assert all(tick.holding for tick in bench.trace)
    commands = np.array([tick.report.command.q for tick in bench.trace])
    assert (commands == commands[0]).all()


def test_one_long_tick_is_late_and_caught_up(bench: Bench) -> None:
    def stall(tick: Tick) -> None:
        bench.solver.takes = 0.050 if tick.index == 9 else 0.001

    begin = bench.clock.now
    pace = bench.runner_with(Spy(stall)).run(1.0)
    ticks = list(bench.trace)
    # The tick of 50 ms, and the ones after it that were due while it lasted.
    assert [tick.index for tick in ticks if tick.lateness > 0.0] == [11, 12]
    assert pace.late_ticks == 2
    assert pace.moved == 0
    # Back on the schedule that was fixed at the beginning.
    assert ticks[-1].report.time == pytest.approx(begin + 49 * CONTROL_PERIOD)
    assert pace.real_time_factor >= 1.0


def test_a_service_that_is_always_too_slow_shows_in_the_factor(toy: RobotDescription) -> None:
    pace = Bench(toy, takes=0.025).runner.run(0.4)
    assert pace.late_ticks == 20
    assert pace.real_time_factor == pytest.approx(0.8)
    assert pace.headroom == pytest.approx(0.8)


def test_after_a_long_gap_the_robot_is_not_rushed(bench: Bench) -> None:
    def suspend(tick: Tick) -> None:
        if tick.index == 4:
            bench.clock.now += 10.0 * MAX_BACKLOG

    begin = bench.clock.now
    pace = bench.runner_with(Spy(suspend)).run(1.0)
    times = [tick.report.time for tick in bench.trace]
    assert pace.moved == 1
    assert np.diff(times).min() == pytest.approx(CONTROL_PERIOD)
    assert times[-1] - begin > 10.0 * MAX_BACKLOG
    assert pace.real_time_factor < 0.3


def test_ctrl_c_ends_a_run_with_its_numbers(bench: Bench) -> None:
    def interrupt(tick: Tick) -> None:
        if tick.index == 6:
            raise KeyboardInterrupt

    pace = bench.runner_with(Spy(interrupt)).run(None)
    assert pace.ticks == len(bench.trace) == 7


def test_runs_as_long_as_it_is_wanted(bench: Bench) -> None:
    pace = bench.runner.run(None, keep_going=lambda: len(bench.trace) < 12)
    assert pace.ticks == 12


def test_no_tick_at_all(bench: Bench) -> None:
    pace = bench.runner.run(1.0, keep_going=lambda: False)
    assert (pace.ticks, pace.real_time_factor, pace.headroom) == (0, 0.0, 0.0)


def test_targets_are_shown(bench: Bench, toy: RobotDescription) -> None:
    left, right = bench.robot.shown_targets()
    target = np.eye(4)
    target[:3, 3] = [0.3, 0.25, 0.05]
    display = TargetDisplay(bench.robot)

    def show(*targets) -> None:
        command = Command(np.zeros(4), np.zeros(4), 0.0)
        report = TickReport(0.0, LoopState.TRACKING, "", command, steps_to(*targets))
        display.observe(Tick(0, 0.02, report, np.zeros(5), (np.eye(4), np.eye(4)), 0.0, 0.001))

    show(target, None)
    np.testing.assert_allclose(bench.robot.shown_targets()[0], target, atol=1e-12)
    np.testing.assert_allclose(bench.robot.shown_targets()[1], right, atol=1e-12)
    show(None, left)
    np.testing.assert_allclose(bench.robot.shown_targets()[0], target, atol=1e-12)
    np.testing.assert_allclose(bench.robot.shown_targets()[1], left, atol=1e-12)
