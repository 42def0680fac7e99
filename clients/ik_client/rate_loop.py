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

import time
from collections.abc import Callable

import numpy as np

from ik_client.arm_joints import aligned
from ik_client.clear_way import ClearWay
from ik_client.gravity_torque import GravityTorque
from ik_client.hold_to_run import HoldToRun
from ik_client.homing import Homing
from ik_client.joint_limiter import JointLimiter
from ik_client.joint_rates import JointRates
from ik_client.partners import ALIGNMENT, UNDER_WAY, Partners
from ik_client.rate_types import MAX_AGE, RateKinematics, RateLaw, RateReport, Wish, WishSource, shown_motion
from ik_client.state_machine import ArmState, Event, Seen, StateMachine
from ik_client.tick import Hold, Tick, resting_goal
from ik_client.types import Command, RobotPort
from ik_proto import Array, VelocityReply

IDLE_EVERY = 0.1
"""Time between two looks at the service while no arm moves [s]."""

STANDS = 1e-3
"""Speed of a joint that counts as standing still [rad/s]."""

_PRESS = "not engaged: press the hold-to-run switch"


class RateLoop:
    """Moves a robot's wrists as an operator's sticks say. One tick per call, paced by the caller."""

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
        self._source = source
        self._limiter = limiter
        self._homing = homing
        self._machine = machine or StateMachine()
        self._clock = clock
        self._switch = HoldToRun()
        partners = self._partners = Partners(ik, port, lambda: self.state in UNDER_WAY, clock)
        law = law or RateLaw()
        self._rates = JointRates(ik, partners, law, limiter)
        self._torque = GravityTorque(ik) if feed_forward else None
        self._way = ClearWay(limiter, partners.clearance) if law.collision in (None, "avoid") else None
        self._tau: Array | None = None
        self._looked = -np.inf
        self._reason, self._absent = _PRESS, ""

    @property
    def session(self) -> str:
        """Random name of this run, part of every command."""
        return self._partners.session

    @property
    def state(self) -> ArmState:
        """State of both arms."""
        return self._machine.state

    @property
    def rests(self) -> bool:
        """Whether the last tick changed nothing of the command, and no torque of where the arms stand is to come."""
        last = self._partners.last
        if last is None or not self._partners.same:
            return False
        if self._torque is None or self._partners.service.trouble(self._clock()):
            return True
        return self._torque.is_of(last.q) and self._tau is not None and np.array_equal(last.tau, self._tau)

    def stop(self, reason: str = "stopped") -> None:
        """Disarm. The state has changed when this returns; the next tick brakes and tells the robot.

        Args:
            reason: Why, in one line.
        """
        self._step(Event.REVOKED, self._clock(), reason)

    def release(self) -> None:
        """Disarm, and tell the robot to take its arms back: the last thing a loop does, and only on purpose."""
        self.stop("released")
        self._partners.release()

    def tick(self) -> RateReport:
        """Read, look at the operator, ask, limit, send.

        Returns:
            What was done and why.

        Raises:
            Exception: The robot could not be read in the very first tick, or could not be sent a command in this one.
        """
        tick, last = self._partners.begin()
        wish = self._look_at_operator(tick)
        self._judge(tick, wish, last)
        reply, q = None, None
        if self.state is ArmState.ACTIVE and wish is not None:
            reply, q = self._follow(tick, wish, last)
        moving = q is not None
        homing = moving and wish is not None and wish.home
        if q is None:
            q = self._rest(tick, last)
        wrists = self._torque.wrists if self._torque else None
        motion = shown_motion(wish, reply, wrists) if moving else None
        command = self._partners.send(q, last.tau if self._tau is None else self._tau, tick.time, motion=motion)
        sent = self._clock()
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
        trouble = self._partners.trouble(tick.time)
        stop = "stopped by the operator" if wish and wish.stop else ""
        revoked = self._absent or stop or self._partners.revoked(tick.time)
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
                velocity = self._rates.ramped(self._home(len(last.q)).velocity(last.q))
            else:
                reply = self._rates.asked(tick, last, wish.twists, wish.frame)
                velocity = self._rates.answered(reply, len(last.q), tick.time)
            return reply, self._move(tick, velocity, last)
        except Exception as error:  # whatever goes wrong in a client, the robot must be told to hold in this very tick
            tick.note(error)
            return reply, None

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

    def _look_at_service(self, tick: Tick, last: Command) -> VelocityReply | None:
        """Ask something small of the service while no arm moves: is it there, is it the same, how are the arms?"""
        if 0.0 <= tick.time - self._looked < IDLE_EVERY:
            return None
        self._looked = tick.time
        try:
            reply = self._rates.asked(tick, last, np.zeros((2, 6)))
            self._partners.heard()
        except Exception as error:
            tick.note(error)
            return None
        return reply

    def _ask_torque(self, tick: Tick, command: Command) -> None:
        """Ask for the gravity torque of the next commands, where it is time."""
        if self._torque is None or not self._torque.due(tick.time) or self._partners.service.trouble(tick.time):
            return
        try:
            tau, boot_id = self._torque.ask(command.q, tick.waist, tick.time)
            self._partners.same_run(boot_id)
            self._tau = tau
        except Exception as error:  # the torque stays as it was
            tick.note(error)

    def _home(self, n: int) -> Homing:
        if self._homing is None:
            self._homing = Homing(np.zeros(n))
        return self._homing
