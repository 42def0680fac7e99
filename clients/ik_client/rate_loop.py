"""The rate loop: an operator's twists in, joint velocities from the service, integrate, limit, command out; every tick.

| situation                                              | the arms                                            |
|--------------------------------------------------------|-----------------------------------------------------|
| active, answer usable                                  | move at the answered velocities                     |
| active, home asked for                                 | go home by `Homing`, straight through joint space   |
| active, answer late, failed, refused or unusable       | brake within their limits in this tick, then go on  |
| service or robot in trouble for longer than a moment   | hold, then disarm: see `state_machine`              |
| switch or operator gone, stop, another run of the      | disarm at once: going on takes a new press          |
| service, the robot lets go                             |                                                     |
| any other state                                        | brake within their limits and hold                  |

- Both arms share one hold-to-run switch and one state. They move only while it is held, after it was seen open.
- A command goes to the robot every tick, whatever happens. Before any press it is where the robot's end holds its
  joints, or where they are measured: so an engagement begins without a step. It is refused where command and
  measurement differ.
- Velocities are integrated from the last command, by the limiter, which is the last link and keeps its bounds whatever
  was answered. Where collisions are avoided, each step and the stop from it are clear of the body (`clear_way`).
- Every tick counts for a period, however late it begins: a caller that keeps a schedule leads the robot evenly, which
  looks at the newest command on a schedule of its own.
- Gravity torque goes along (`gravity_torque`), asked for when the command of a tick is on its way already.
- Only a first tick that cannot read the robot raises: there is nothing to hold yet.

This is not a safety function; the robot side keeps its own watchdog and limiter.
"""

import secrets
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from ik_client.arm_joints import aligned
from ik_client.clear_way import ClearWay
from ik_client.gravity_torque import GravityTorque
from ik_client.hold_to_run import HoldToRun
from ik_client.homing import Homing
from ik_client.joint_limiter import JointLimiter
from ik_client.rate_types import MAX_AGE, RateKinematics, RateLaw, RateReport, Wish, WishSource
from ik_client.robot_watch import RobotWatch
from ik_client.service_watch import ServiceWatch
from ik_client.state_machine import ArmState, Event, Seen, StateMachine
from ik_client.steady_waist import SteadyWaist
from ik_client.teleop import ALIGNMENT
from ik_client.tick import (
    Hold,
    Tick,
    first_command,
    frozen,
    is_finite,
    is_same,
    is_silence,
    one_line,
    resting_goal,
    usable,
)
from ik_client.types import Command, RobotPort
from ik_proto import Array, Reply, VelocityReply
from ik_proto.wrist_motion import WristMotion

R = TypeVar("R", bound=Reply)

IDLE_EVERY = 0.1
"""Time between two looks at the service while no arm moves [s]."""

STANDS = 1e-3
"""Speed of a joint that counts as standing still [rad/s]."""

_PRESS = "not engaged: press the hold-to-run switch"
_UNDER_WAY = frozenset({ArmState.ACTIVE, ArmState.HOLD})
_TOO_FAST = 1.01
"""An answer faster than was allowed by more than this factor is none."""


class RateLoop:
    """Moves a robot's wrists as an operator's sticks say. One tick per call, paced by the caller.

    Attributes:
        session: Random name of this run, part of every command.
    """

    def __init__(
        self,
        ik: RateKinematics,
        source: WishSource,
        port: RobotPort,
        limiter: JointLimiter,
        *,
        law: RateLaw | None = None,
        homing: Homing | None = None,
        feed_forward: bool = True,
        machine: StateMachine | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Put the parts together; nothing moves before the switch is pressed.

        Args:
            ik: An `IKClient`, or anything that answers like it.
            source: Sticks, or what stands for them.
            port: The robot. The first half of its joints is the left arm, the second the right.
            limiter: Bounds the motion; its period is the loop's.
            law: How twists become joint velocities.
            homing: Where home is; None for the posture with all joints at zero.
            feed_forward: Send the gravity torque along with the joints; else the torque is what it was.
            machine: The states.
            clock: Monotonic time [s].
        """
        self.session = secrets.token_hex(6)
        self._ik = ik
        self._source = source
        self._port = port
        self._limiter = limiter
        self._law = law or RateLaw()
        self._options = {name: value for name, value in _fields(self._law).items() if value is not None}
        self._homing = homing
        self._machine = machine or StateMachine()
        self._clock = clock
        self._switch = HoldToRun()
        self._service, self._robot, self._waist = ServiceWatch(), RobotWatch(), SteadyWaist()
        self._torque = GravityTorque(ik) if feed_forward else None
        self._way = ClearWay(limiter, self._clearance) if self._law.collision in (None, "avoid") else None
        self._last: Command | None = None
        self._rests = False
        self._tau: Array | None = None
        self._looked = -np.inf
        self._reason, self._absent = _PRESS, ""

    @property
    def state(self) -> ArmState:
        """State of both arms."""
        return self._machine.state

    @property
    def rests(self) -> bool:
        """Whether the last tick changed nothing of the command, and no torque of where the arms stand is to come."""
        return self._rests

    def stop(self, reason: str = "stopped") -> None:
        """Disarm. The state has changed when this returns; the next tick brakes and tells the robot.

        Args:
            reason: Why, in one line.
        """
        self._step(Event.REVOKED, self._clock(), reason)

    def release(self) -> None:
        """Disarm, and tell the robot to take its arms back: the last thing a loop does, and only on purpose."""
        self.stop("released")
        if self._last is not None:
            self._send(self._last.q, self._clock(), release=True)

    def tick(self) -> RateReport:
        """Read, look at the operator, ask, limit, send.

        Returns:
            What was done and why.

        Raises:
            Exception: The robot could not be read in the very first tick, or could not be sent a command in this one.
        """
        tick = Tick(self._clock())
        if self._last is None:
            tick.measured = self._port.read()
            self._last = first_command(tick.measured, tick.time)
        last = self._last
        robot_fault = tick.read(self._port, self._waist, len(last.q))
        self._robot.look(tick.measured, robot_fault, last.engaged, tick.time)
        wish = self._look_at_operator(tick)
        self._judge(tick, wish, last)
        reply, q = None, None
        homing = wish is not None and wish.home
        if self.state is ArmState.ACTIVE and wish is not None:
            reply, q = self._follow(tick, wish, last)
        moving = q is not None
        homing = homing and moving
        if q is None:
            q = self._rest(tick, last)
        command = self._send(q, tick.time, self._motion(wish, reply) if moving else None)
        sent = self._clock()
        unknown = self._torque is not None and not self._torque.is_of(command.q) and not self._service.trouble(sent)
        self._rests = is_same(command, last) and not unknown
        idle = None if moving else self._look_at_service(tick, command)
        self._ask_torque(tick, command)
        at_home = self._home(len(q)).arrived(q)
        return RateReport(
            time=tick.time,
            state=self.state,
            moving=moving,
            reason="" if moving else tick.reason or self._absent or self._reason,
            command=command,
            sent=sent,
            wish=wish,
            homing=homing,
            at_home=at_home,
            blocked=homing and not at_home and float(np.abs(self._limiter.velocity).max()) < STANDS,
            measured=tick.measured,
            reply=reply or idle,
            round_trip=tick.round_trip,
            fault=tick.fault,
        )

    def _look_at_operator(self, tick: Tick) -> Wish | None:
        """What the operator wants; None where that is not known: an old wish, or one that is no numbers, is none."""
        try:
            wish = self._source.wish(tick.time)
            if wish is None or not 0.0 <= tick.time - wish.time <= MAX_AGE:
                raise Hold("nothing is heard of the operator")
            if np.shape(wish.twists) != (2, 6) or not np.isfinite(wish.twists).all():
                raise Hold("the wanted twists must be two rows of 6 finite numbers and are not")
            self._absent = "" if wish.held is not None else "the hold-to-run switch is gone"
            return wish
        except Exception as error:  # a device's fault is an operator that is lost
            self._absent = tick.note(error)
            return None

    def _judge(self, tick: Tick, wish: Wish | None, last: Command) -> None:
        """Take the state a tick further."""
        trouble = self._robot.trouble() or self._service.trouble(tick.time)
        stop = "stopped by the operator" if wish and wish.stop else ""
        revoked = self._absent or stop or self._robot.revoked(tick.time) or self._service.revoked()
        grip = self._switch.update(wish.held if wish else None, not trouble and not revoked)
        measured = tick.measured
        agrees = measured is not None and all(aligned(last.q, measured.q, side, ALIGNMENT) for side in (0, 1))
        event = self._machine.event(Seen(grip, not trouble, agrees, revoked=bool(revoked)), tick.time)
        why = {
            Event.REVOKED: revoked,
            Event.TIMEOUT: f"{self.state} for too long: press again",
            Event.LOST: trouble,
            Event.RELEASED: "the hold-to-run switch was released",
            Event.PRESSED: "pressed: waiting until command and measurement agree",
        }
        self._step(event, tick.time, why.get(event, ""))

    def _step(self, event: Event, now: float, why: str) -> None:
        before = self.state
        after = self._machine.step(event, now)
        if after is not before:
            self._reason = "" if after is ArmState.ACTIVE else _PRESS if self._absent else why

    def _follow(self, tick: Tick, wish: Wish, last: Command) -> tuple[VelocityReply | None, Array | None]:
        """The answer, and the next joints; None for them where the tick cannot follow."""
        reply = None
        try:
            if tick.measured is None:
                raise Hold("the robot cannot be read")
            if wish.home:
                velocity = self._ramped(self._home(len(last.q)).velocity(last.q))
            else:
                reply = self._ask(tick, wish.twists, wish, last)
                velocity = self._usable(reply, len(last.q), tick.time)
            return reply, self._move(tick, velocity, last)
        except Exception as error:  # whatever goes wrong in a client, the robot must be told to hold in this very tick
            tick.note(error)
            return reply, None

    def _ask(self, tick: Tick, twists: Array, wish: Wish | None, last: Command) -> VelocityReply:
        begin = self._clock()
        try:
            return self._heard(
                lambda: self._ik.velocity(
                    twists[0],
                    twists[1],
                    last.q,
                    self._limiter.velocity,
                    frame=wish.frame if wish else "pelvis",
                    period=self._limiter.period,
                    waist=tick.waist,
                    **self._options,
                )
            )
        finally:
            tick.round_trip = self._clock() - begin

    def _usable(self, reply: VelocityReply, n: int, now: float) -> Array:
        """The velocities of an answer; raises where they cannot be followed."""
        try:
            if not reply.success:
                raise Hold(f"{reply.status}: {reply.error}")
            dq = usable(reply.dq, n, "the answer")
            if np.abs(dq).max() > _TOO_FAST * max(self._law.max_speed, float(np.abs(self._limiter.velocity).max())):
                raise Hold("the answer is faster than was allowed")
        except Hold as hold:
            self._service.failed(str(hold), now)
            raise
        self._service.succeeded()
        return dq

    def _ramped(self, wanted: Array) -> Array:
        """A velocity towards the wanted one, no faster than the largest acceleration, all joints by the same share.

        The service does so with its answers; where each joint was left to the limiter, the way would be bent.
        """
        velocity = self._limiter.velocity
        change = wanted - velocity
        most = self._law.max_acceleration * self._limiter.period
        return velocity + change * min(1.0, most / max(float(np.abs(change).max()), 1e-12))

    def _move(self, tick: Tick, velocity: Array, last: Command) -> Array:
        if self._way is None:
            return self._limiter.move(last.q, velocity)
        return self._way.move(last.q, velocity, None, tick.measured.waist if tick.measured else None)

    def _rest(self, tick: Tick, last: Command) -> Array:
        """Brake and hold, or go to where the robot's end holds its joints."""
        goal = resting_goal(tick.measured, last)
        if np.isfinite(goal).all():
            return self._limiter.limit(last.q, goal)
        return self._limiter.move(last.q, np.zeros(len(last.q)))

    def _clearance(self, q: Array, waist: Array | None) -> Array:
        """Smallest distance between two parts of the body at each row of joints [m]."""
        reply = self._heard(lambda: self._ik.clearance(q, waist))
        return np.full(len(q), np.inf) if reply.clearance is None else reply.clearance

    def _look_at_service(self, tick: Tick, last: Command) -> VelocityReply | None:
        """Ask something small of the service while no arm moves: is it there, is it the same, how are the arms?"""
        if 0.0 <= tick.time - self._looked < IDLE_EVERY:
            return None
        self._looked = tick.time
        try:
            reply = self._ask(tick, np.zeros((2, 6)), None, last)
            self._service.heard(engaged=self._under_way)
        except Exception as error:
            tick.note(error)
            return None
        return reply

    def _ask_torque(self, tick: Tick, command: Command) -> None:
        """Ask for the gravity torque of the next commands, where it is time."""
        if self._torque is None or not self._torque.due(tick.time) or self._service.trouble(tick.time):
            return
        try:
            tau, boot_id = self._torque.ask(command.q, tick.waist, tick.time)
            self._same_run(boot_id)
            self._tau = frozen(np.array(tau))
        except Exception as error:  # the torque stays as it was
            tick.note(error)

    def _heard(self, ask: Callable[[], R]) -> R:
        """Ask the service something, and take note of how that went."""
        try:
            reply = ask()
        except Exception as error:
            self._service.failed(one_line(error), self._clock(), silent=is_silence(error))
            raise
        self._same_run(reply.boot_id)
        return reply

    def _same_run(self, boot_id: str) -> None:
        """Refuse an answer of another run of the service than the one the arms have followed so far."""
        if not self._service.answered(boot_id, engaged=self._under_way):
            raise Hold("another run of the service answers now")

    @property
    def _under_way(self) -> bool:
        """Whether the arms follow, or may go on without another press."""
        return self.state in _UNDER_WAY

    def _home(self, n: int) -> Homing:
        if self._homing is None:
            self._homing = Homing(np.zeros(n))
        return self._homing

    def _motion(self, wish: Wish | None, reply: VelocityReply | None) -> WristMotion | None:
        """What to show of a tick, in the pelvis frame; None where that is not known."""
        if wish is None or reply is None or not all(is_finite(row, 6) for row in reply.twists):
            return None
        asked, achieved = wish.twists, reply.twists
        if wish.frame == "hand":
            if self._torque is None or self._torque.wrists is None:
                return None
            asked, achieved = (_turned(self._torque.wrists, twists) for twists in (asked, achieved))
        return WristMotion(asked, achieved, reply.manipulability, reply.limited_by, reply.limiting_joint)

    def _send(self, q: Array, now: float, motion: WristMotion | None = None, release: bool = False) -> Command:
        last = self._last
        tau = self._tau if self._tau is not None else last.tau if last else np.zeros(len(q))
        command = Command(
            frozen(np.array(q)),
            tau,
            now,
            session=self.session,
            seq=last.seq + 1 if last else 1,
            boot_id=self._service.boot_id,
            engaged=self._under_way,
            release=release,
            motion=motion,
        )
        self._last = command
        self._port.send(command)
        return command


def _fields(law: RateLaw) -> dict:
    return {name: getattr(law, name) for name in RateLaw.__slots__}


def _turned(wrists: tuple[Array, Array], twists: Array) -> Array:
    """Twists along the hands' axes, in the pelvis frame, shape (2, 6)."""
    rows = [np.concatenate([T[:3, :3] @ row[:3], T[:3, :3] @ row[3:]]) for T, row in zip(wrists, twists, strict=True)]
    return np.array(rows)
