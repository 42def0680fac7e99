"""Whom a loop works with: the service that it asks, and the robot that it leads.

A tick begins with a look at the robot and ends with one command to it. Whatever the service is asked in between goes
through here, so how that went is taken note of once: an answer of another run of it than the one that is followed is
refused, and what fails makes trouble by the rules of `service_watch`.

Only a first tick that cannot read the robot raises: there is nothing to hold yet.
"""

import secrets
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from ik_client.robot_watch import RobotWatch
from ik_client.service_watch import ServiceWatch
from ik_client.state_machine import ArmState
from ik_client.steady_waist import SteadyWaist
from ik_client.tick import Hold, Tick, first_command, frozen, is_same, is_silence, one_line
from ik_client.types import Command, Kinematics, RobotPort
from ik_proto import Array, FkReply, Reply, SolveReply, VelocityReply
from ik_proto.wrist_motion import WristMotion

R = TypeVar("R", bound=Reply)
T = TypeVar("T")

UNDER_WAY = frozenset({ArmState.ACTIVE, ArmState.HOLD})
"""States of an arm that follows, or may go on without another grip."""

ALIGNMENT = 0.1
"""Largest difference of a joint's command and measurement with which an arm may be engaged [rad]."""


class Partners:
    """A service and a robot, as one loop knows them.

    Attributes:
        session: Random name of this run, part of every command.
        service: How the service does.
        waist: Takes the swing out of the robot's waist.
        last: The last command; before any, where the robot is held. None before the first tick.
        same: Whether the last command changed nothing of the one before.
    """

    def __init__(
        self, ik: Kinematics, port: RobotPort, under_way: Callable[[], bool], clock: Callable[[], float]
    ) -> None:
        """Meet neither of them yet.

        Args:
            ik: The service.
            port: The robot.
            under_way: Whether an arm follows, or may go on without another grip.
            clock: Monotonic time [s].
        """
        self.session = secrets.token_hex(6)
        self.service = ServiceWatch()
        self.waist = SteadyWaist()
        self.last: Command | None = None
        self.same = False
        self._ik = ik
        self._port = port
        self._under_way = under_way
        self._clock = clock
        self._robot = RobotWatch()

    def begin(self) -> tuple[Tick, Command]:
        """Begin a tick with a look at the robot.

        Returns:
            The tick, and the last command.

        Raises:
            Exception: There was no command yet, and the robot could not be read.
        """
        tick = Tick(self._clock())
        if self.last is None:
            tick.measured = self._port.read()
            self.last = first_command(tick.measured, tick.time)
        fault = tick.read(self._port, self.waist, len(self.last.q))
        self._robot.look(tick.measured, fault, self.last.engaged, tick.time)
        return tick, self.last

    def trouble(self, now: float) -> str:
        """Why no arm can follow now; empty where one can."""
        return self._robot.trouble() or self.service.trouble(now)

    def revoked(self, now: float) -> str:
        """Why an operator's grip counts no longer; empty where it does. Asking settles it."""
        return self._robot.revoked(now) or self.service.revoked()

    def ask(self, question: Callable[[], R]) -> R:
        """Ask the service something.

        Raises:
            Hold: Another run of it answers than the one that is followed.
            Exception: There is no answer.
        """
        try:
            reply = question()
        except Exception as error:
            self.service.failed(one_line(error), self._clock(), silent=is_silence(error))
            raise
        self.same_run(reply.boot_id)
        return reply

    def ask_timed(self, tick: Tick, question: Callable[[], R]) -> R:
        """Ask what a tick is about: the same, and the tick knows how long it took."""
        begin = self._clock()
        try:
            return self.ask(question)
        finally:
            tick.round_trip = self._clock() - begin

    def same_run(self, boot_id: str) -> None:
        """Take note of who answered.

        Raises:
            Hold: Another run of the service than the one that is followed.
        """
        if not self.service.answered(boot_id, engaged=self._under_way()):
            raise Hold("another run of the service answers now")

    def solution(self, reply: SolveReply | VelocityReply, now: float, read: Callable[[], T]) -> T:
        """What an answer says to do, and whether that can be done.

        Args:
            reply: The answer.
            now: Time of the tick [s].
            read: Reads it; raises `Hold` where it is of no use.

        Raises:
            Hold: It cannot be followed.
        """
        try:
            if not reply.success:
                raise Hold(f"{reply.status}: {reply.error}")
            found = read()
        except Hold as hold:
            self.service.failed(str(hold), now)
            raise
        self.service.succeeded()
        return found

    def heard(self) -> None:
        """Note that the service answers, if not with a solution."""
        self.service.heard(engaged=self._under_way())

    def fk(self, q: Array, waist: Array | None) -> FkReply:
        """Where the wrists are; raises as `ask`."""
        reply = self.ask(lambda: self._ik.fk(q, waist))
        self.heard()
        return reply

    def clearance(self, q: Array, waist: Array | None) -> Array:
        """Smallest distance between two parts of the body at each row of joints, shape (k,) [m]; raises as `ask`."""
        reply = self.ask(lambda: self._ik.clearance(q, waist))
        return np.full(len(q), np.inf) if reply.clearance is None else reply.clearance

    def send(
        self, q: Array, tau: Array, now: float, *, motion: WristMotion | None = None, release: bool = False
    ) -> Command:
        """Command the robot.

        Args:
            q: Joints, shape (n,) [rad].
            tau: Feed-forward torque, shape (n,) [N m].
            now: Time of the tick [s].
            motion: How the wrists were asked to move.
            release: Whether the robot shall take its arms back.

        Raises:
            Exception: The robot cannot be sent anything.
        """
        last = self.last
        command = Command(
            frozen(np.array(q)),
            frozen(np.array(tau)),
            now,
            session=self.session,
            seq=last.seq + 1 if last else 1,
            boot_id=self.service.boot_id,
            engaged=self._under_way(),
            release=release,
            motion=motion,
        )
        self.last, self.same = command, last is not None and is_same(command, last)
        self._port.send(command)
        return command

    def release(self) -> None:
        """Tell the robot to take its arms back, where it was commanded before."""
        if self.last is not None:
            self.send(self.last.q, self.last.tau, self._clock(), release=True)
