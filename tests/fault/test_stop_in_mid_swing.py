"""Arms that are stopped in mid-swing, whatever stops them, hang where they are held: by the torque of that posture.

Loop, service and simulated robot take turns on a clock of the test's own. The oracle of torques is Pinocchio.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ik_client import ArmState, Hands, HandSample, IKClient, ServiceTimeout, TeleopLoop, TickReport
from ik_client.ending import LONGEST, come_to_rest
from ik_client.joint_limiter import JointLimiter
from ik_client.pacer import Pacer
from ik_client.resting_torque import RATE
from ik_proto import Array, ClearanceReply, FkReply, SolveReply
from ik_proto.robots import load_description
from ik_service.robot import Robot
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.sources import scripted_arm

BOTH_ACTIVE = (ArmState.ACTIVE, ArmState.ACTIVE)
G1 = load_description("g1")
MIRRORED = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
LOW, HIGH = (np.array([pitch, 0.25, 0.0, 1.2, 0.0, 0.0, 0.0]) for pitch in (0.3, -2.6))
"""Joints of the left arm: hands before the belly, and above the head [rad]."""

IN_MID_SWING = 0.2
"""When a swing from low to high is stopped [s]: the shoulders move at nearly 3 rad/s, and an upper arm is level."""

BESIDE = 0.005
"""How far a joint may hang beside its command [rad]. With the torque of the last answer it is 0.02."""

TORQUE_ERROR = 0.2
"""How wrong the torque of a posture may be [N m]: the waist comes to rest after the arms. That of the last answer is
wrong by 2."""


class Service:
    """The service, which may fall silent."""

    def __init__(self, ik: IKClient) -> None:
        self.ik = ik
        self.silent = False

    def solve(self, *args: Any, **options: Any) -> SolveReply:
        """As the service, or as nobody."""
        return self._heard().solve(*args, **options)

    def fk(self, q: Array, waist: Array | None = None) -> FkReply:
        """As the service, or as nobody."""
        return self._heard().fk(q, waist)

    def clearance(self, q: Array, waist: Array | None = None) -> ClearanceReply:
        """As the service, or as nobody."""
        return self._heard().clearance(q, waist)

    def _heard(self) -> IKClient:
        if self.silent:
            raise ServiceTimeout("tcp://127.0.0.1:1", 0.01)
        return self.ik


class Swing:
    """Both arms have been low, and are on their way up."""

    def __init__(self, ik: IKClient) -> None:
        self.now = 0.0
        self.service = Service(ik)
        self.robot = SimRobot(G1, clock=lambda: self.now, ramp=CONTROL_PERIOD)
        self.grip: list[bool] = [False, False]
        self.seen = True
        info = ik.info()
        self.limiter = JointLimiter(len(info.joint_names), CONTROL_PERIOD, lower=info.lower, upper=info.upper)
        arms = (scripted_arm(), scripted_arm())
        self.loop = TeleopLoop(
            self.service, self, self.robot, self.limiter, arms=arms, feed_forward=True, clock=lambda: self.now
        )
        self.poses = self.robot.wrists()
        self.torques: list[Array] = []
        self.ticks(0.2)
        self.grip = [True, True]
        begin, low = self.robot.read().q, np.concatenate([LOW, LOW * MIRRORED])
        for share in np.linspace(0.0, 1.0, 100):
            self.lead(begin + share * (low - begin))
            self.ticks(CONTROL_PERIOD)
        self.ticks(0.5)
        self.lead(np.concatenate([HIGH, HIGH * MIRRORED]))
        self.ticks(IN_MID_SWING)
        assert self.loop.states == BOTH_ACTIVE
        assert np.abs(self.limiter.velocity).max() > 2.5
        self.torques.clear()

    def lead(self, q: Array) -> None:
        """Bring the hands to where the wrists are at some joints."""
        wrists = self.service.ik.fk(q)
        self.poses = wrists.left_wrist, wrists.right_wrist

    def hands(self, now: float) -> Hands | None:
        """What the operator does."""
        left, right = (HandSample(T, grip, now) for T, grip in zip(self.poses, self.grip, strict=True))
        return Hands(left, right) if self.seen else None

    def tick(self) -> TickReport:
        """A tick of the loop; the robot has not moved yet."""
        self.report = self.loop.tick()
        self.torques.append(self.report.command.tau)
        return self.report

    def pause(self, seconds: float) -> None:
        """Let the robot move, for whole ticks."""
        for _ in range(round(seconds / CONTROL_PERIOD)):
            self.now += CONTROL_PERIOD
            self.robot.advance()

    def ticks(self, seconds: float) -> None:
        """Let loop and robot go on in turn."""
        for _ in range(round(seconds / CONTROL_PERIOD)):
            self.tick()
            self.pause(CONTROL_PERIOD)

    def torque_error(self) -> float:
        """How far the commanded torque is from that of the commanded posture [N m]."""
        command, waist = self.report.command, self.robot.read().waist
        return float(np.abs(command.tau - Robot.load(G1).gravity_torque(command.q, waist)).max())

    def beside(self) -> float:
        """How far a joint hangs beside its command [rad]."""
        return float(np.abs(self.robot.read().q - self.report.command.q).max())

    def largest_step(self) -> float:
        """Largest change of a commanded torque from a tick to the next since the swing was stopped [N m]."""
        return float(np.abs(np.diff(self.torques, axis=0)).max())


@pytest.fixture
def swing(service_process) -> Iterator[Swing]:
    with IKClient(service_process.tcp_url, timeout=5.0) as ik:
        yield Swing(ik)


def stop(swing: Swing, how: str) -> None:
    if how == "let go":
        swing.grip = [False, False]
    elif how == "lost":
        swing.seen = False
    elif how == "stopped":
        swing.loop.stop()
    elif how == "a silent service":
        swing.service.silent = True
        swing.ticks(0.3)
        swing.service.silent, swing.grip = False, [False, False]


@pytest.mark.parametrize("how", ["let go", "lost", "stopped", "a silent service"])
def test_stopped_arms_hang_where_they_are_held(swing, how):
    """Hazard: stale torque."""
    stop(swing, how)
    swing.ticks(1.5)
    assert not swing.report.command.engaged
    assert swing.torque_error() < TORQUE_ERROR
    assert swing.beside() < BESIDE
    assert swing.largest_step() <= RATE * CONTROL_PERIOD * (1.0 + 1e-9)
    swing.grip = [False, False]
    swing.seen = True
    swing.ticks(0.1)
    swing.grip = [True, True]
    swing.ticks(0.2)
    assert swing.loop.states == BOTH_ACTIVE


def test_an_arm_that_is_let_go_hangs_where_it_is_held_while_the_other_follows(swing):
    swing.grip = [False, True]
    swing.ticks(1.5)
    assert swing.loop.states[1] is ArmState.ACTIVE
    command, waist = swing.report.command, swing.robot.read().waist
    wanted = Robot.load(G1).gravity_torque(command.q, waist)
    assert np.abs(command.tau - wanted)[:7].max() < TORQUE_ERROR
    assert np.abs(swing.robot.read().q - command.q)[:7].max() < BESIDE


def test_without_an_answer_the_last_torque_stays(swing):
    """The negative control: by that torque the arms hang beside their command."""
    before = swing.report.command.tau
    swing.service.silent = True
    swing.ticks(2.0)
    np.testing.assert_array_equal(swing.torques, [before] * len(swing.torques))
    assert swing.torque_error() > 5.0 * TORQUE_ERROR
    assert swing.beside() > 2.0 * BESIDE


@pytest.mark.parametrize("silent", [False, True])
def test_a_loop_that_ends_in_mid_swing_leaves_the_arms_where_they_are_held(swing, silent):
    """The robot hears no more of it. Hazard: stale torque."""
    swing.service.silent = silent
    begin = swing.now
    come_to_rest(swing.loop, "the test ends", swing.tick, Pacer(CONTROL_PERIOD, lambda: swing.now, swing.pause))
    assert swing.now - begin <= LONGEST + CONTROL_PERIOD
    assert swing.loop.rests
    swing.pause(1.5)
    assert (swing.beside() < BESIDE) is not silent
    assert (swing.torque_error() < TORQUE_ERROR) is not silent
