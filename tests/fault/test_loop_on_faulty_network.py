"""The teleop loop, a real service and a bad network between them: the arms follow or hold, within bounds, always.

The loop's clock is the test's, the sockets are real. Hazard rows: lost connection; velocity / acceleration / jerk;
service restart (the client's side).
"""

import random
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest
from faults import Plan
from faulty_proxy import FaultyProxy

from ik_client import ArmState, Command, Hands, HandSample, IKClient, LoopState, RobotState, TeleopLoop, TickReport
from ik_client.joint_limiter import JointLimiter, MotionLimits

pytest.importorskip("ruckig")

N = 14
TICK = 0.01
LIMITS = MotionLimits()
SLACK = 1.0 + 1e-6
TIMEOUT = 0.03
PATIENCE = 4000
"""Ticks after which something that should have happened will not."""
OPEN = np.array([-0.3, 0.35, 0.0, 1.0, 0.0, 0.0, 0.0, -0.3, -0.35, 0.0, 1.0, 0.0, 0.0, 0.0])
"""Arms a little away from the body, hands in front [rad]."""


@dataclass
class Robot:
    """Is where it was last sent to."""

    commands: list[Command] = field(default_factory=list)

    def read(self) -> RobotState:
        q = self.commands[-1].q if self.commands else OPEN
        return RobotState(q.copy(), np.zeros(N), 0.0)

    def send(self, command: Command) -> None:
        self.commands.append(command)


@dataclass
class Operator:
    """Two hands that circle without end, and a grip that is let go and taken again where the arms are disarmed."""

    grip: bool = False
    grips_again: bool = True
    _open: int = 0

    def hands(self, now: float) -> Hands:
        pose = np.eye(4)
        pose[:3, 3] = 0.06 * np.array([np.sin(2.0 * now), np.cos(2.0 * now), np.sin(1.3 * now)])
        return Hands(HandSample(pose, self.grip, now), HandSample(pose, self.grip, now))

    def watch(self, states: tuple[ArmState, ArmState]) -> None:
        """Look at the arms after a tick."""
        if not self.grips_again:
            return
        self._open = self._open + 1 if ArmState.DISARMED in states else 0
        self.grip = not 1 <= self._open % 40 <= 3  # open for three ticks, then a patient try


class Bench:
    """Everything put together, one tick a call."""

    def __init__(self, proxy: FaultyProxy, ik: IKClient) -> None:
        self.proxy, self.ik = proxy, ik
        self.now = 100.0
        self.robot, self.operator = Robot(), Operator()
        limiter = JointLimiter(N, TICK, LIMITS)
        self.loop = TeleopLoop(ik, self.operator, self.robot, limiter, clock=lambda: self.now)
        self.reports: list[TickReport] = []

    def tick(self) -> TickReport:
        self.now += TICK
        report = self.loop.tick()
        self.operator.watch(self.loop.states)
        self.reports.append(report)
        return report

    def until(self, condition) -> None:
        for _ in range(PATIENCE):
            if condition(self.tick()):
                return
        pytest.fail(f"not within {PATIENCE} ticks; the last one: {self.reports[-1].reason}")

    def both(self, state: ArmState) -> bool:
        return self.loop.states == (state, state)

    def still(self, ticks: int) -> bool:
        """Whether no command differed from the one before it in the last ticks."""
        q = np.stack([command.q for command in self.robot.commands[-ticks:]])
        return bool(np.all(q == q[0]))

    def check(self) -> None:
        """One command a tick, each finite and within the bounds; and nothing but a usable answer was followed."""
        assert len(self.robot.commands) == len(self.reports)
        q = np.stack([OPEN, OPEN, *(command.q for command in self.robot.commands)])
        assert np.isfinite(q).all()
        v = np.diff(q, axis=0) / TICK
        assert np.abs(v).max() <= LIMITS.velocity * SLACK
        assert np.abs(np.diff(v, axis=0) / TICK).max() <= LIMITS.acceleration * SLACK
        for report in self.reports:
            if report.state is LoopState.TRACKING:
                assert report.reply is not None
                assert report.reply.success
                assert any(step.state is ArmState.ACTIVE for step in report.arms)


@pytest.fixture
def bench(service_process) -> Iterator[Bench]:
    proxy = FaultyProxy(service_process.tcp)
    try:
        with IKClient(proxy.url, timeout=TIMEOUT, connect_timeout=10.0) as ik:
            yield Bench(proxy, ik)
    finally:
        proxy.stop()


@pytest.mark.parametrize("seed", [1, 2])
def test_on_a_bad_network_the_arms_follow_or_hold_and_go_on_when_it_is_well(bench: Bench, seed: int) -> None:
    """Hazard rows: lost connection; velocity / acceleration / jerk."""
    bench.until(lambda _: bench.both(ArmState.ACTIVE))
    rng = random.Random(seed)
    plans = Plan.random(rng, 60, 0.35), Plan.random(rng, 60, 0.35)
    bench.proxy.to_service, bench.proxy.to_client = plans
    bench.until(lambda _: all(plan.seen >= 60 for plan in plans))
    held = [report for report in bench.reports if report.state is LoopState.HOLDING and report.fault is not None]
    assert len({type(report.fault) for report in held}) > 1
    bench.proxy.mend()
    tracked = 0

    def follows(report: TickReport) -> bool:
        nonlocal tracked
        tracked = tracked + 1 if report.state is LoopState.TRACKING else 0
        return tracked >= 50

    bench.until(follows)
    bench.check()
    q = np.stack([command.q for command in bench.robot.commands])
    assert np.ptp(q, axis=0).max() > 0.1


def test_a_network_that_falls_silent_ends_the_motion_and_then_the_grip(bench: Bench) -> None:
    """Hazard row: lost connection. Nothing moves again before a new grip, although the old one is still held."""
    bench.until(lambda _: bench.both(ArmState.ACTIVE))
    for _ in range(30):
        bench.tick()
    target, bench.proxy.target = bench.proxy.target, ("127.0.0.1", 9)
    bench.proxy.hang_up()
    bench.operator.grips_again = False
    bench.until(lambda _: bench.both(ArmState.DISARMED))
    bench.until(lambda _: bench.still(20))
    bench.proxy.target = target
    for _ in range(50):
        bench.tick()
    assert bench.operator.grip
    assert bench.both(ArmState.DISARMED)
    assert bench.still(50)
    bench.operator.grips_again = True
    bench.until(lambda _: bench.both(ArmState.ACTIVE))
    bench.check()


def test_another_run_of_the_service_behind_the_same_address_disarms(bench: Bench, start_service) -> None:
    """Hazard row: service restart. Its answers are not followed before a new grip."""
    other = start_service("--zenoh", "off", "--http", "off")
    bench.until(lambda _: bench.both(ArmState.ACTIVE))
    for _ in range(30):
        bench.tick()
    first = bench.ik.boot_id
    bench.proxy.target = other.tcp
    bench.proxy.hang_up()
    bench.operator.grips_again = False
    bench.until(lambda _: bench.ik.boot_id != first)
    assert bench.reports[-1].state is LoopState.HOLDING
    bench.until(lambda _: bench.both(ArmState.DISARMED))
    assert not any(
        report.reply is not None and report.reply.boot_id != first and report.state is LoopState.TRACKING
        for report in bench.reports
    )
    bench.until(lambda _: bench.still(20))
    assert bench.operator.grip
    assert bench.both(ArmState.DISARMED)
    bench.operator.grips_again = True
    bench.until(lambda _: bench.both(ArmState.ACTIVE))
    assert bench.robot.commands[-1].boot_id == other.ready["boot_id"]
    bench.check()
