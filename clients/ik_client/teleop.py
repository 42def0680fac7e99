"""The teleop loop: hands in, solve, limit, command out, once per tick.

Each arm has its own gate, grip, states and clutch (`engagement`); both share the service, the robot and the limiter.

| situation                                              | the arm                                             |
|--------------------------------------------------------|-----------------------------------------------------|
| active, answer usable                                  | a limited step towards the answer                   |
| active, any error, no success, an unusable answer      | brakes within its limits in this tick, then goes on |
| service or robot in trouble for longer than a moment   | holds, then disarms: see `state_machine`            |
| another run of the service answers, the robot lets go  | disarms at once: going on takes a new grip          |
| any other state                                        | brakes within its limits and holds                  |

- A command goes to the robot every tick, whatever happens. Before any grip it is where the robot's end holds its joints
  or, where it does not say, the joints measured first. It never goes home by itself.
- The solve starts from the last command while every joint agrees with the measurement within `agreement`, else from the
  measured joints: a solver that starts from a sagging arm creeps after it.
- An arm that holds while the other follows is solved for where it is. Should the answer need it elsewhere, to keep the
  two apart, the other arm waits.
- The measured waist without its swing (`steady_waist`), and the elbow directions and weights a tracker gives, go with
  every solve.
- The feed-forward torque advances by the same fraction of its way as the joints of its arm. That of an arm that holds
  goes evenly to the torque of where it rests, asked for when the command of a tick is on its way (`resting_torque`).
- Only a first tick that cannot read the robot raises: there is nothing to hold yet.

This is not a safety function; the robot side keeps its own watchdog and limiter.
"""

import contextlib
import secrets
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from ik_client.arm_joints import SIDES, aligned, joints_of, torque_on_the_way
from ik_client.clear_way import ClearWay
from ik_client.engagement import ArmEngagement, ArmStep
from ik_client.joint_limiter import JointLimiter
from ik_client.resting_torque import KNOWN_WITHIN, RestingTorque
from ik_client.resting_wrists import RestingWrists
from ik_client.robot_watch import RobotWatch
from ik_client.service_watch import ServiceWatch
from ik_client.state_machine import ArmState
from ik_client.steady_waist import SteadyWaist
from ik_client.tick import (
    NO_HANDS,
    NO_STEP,
    Hold,
    Tick,
    first_command,
    frozen,
    is_same,
    is_silence,
    one_line,
    resting_goal,
    usable,
)
from ik_client.tick_report import Seed, TickReport
from ik_client.types import Command, HandSource, Kinematics, Limiter, RobotPort, RobotState
from ik_proto import Array, Collision, FkReply, Reply, SolveReply
from ik_proto.smoothing import WeightedMovingFilter

R = TypeVar("R", bound=Reply)

ALIGNMENT = 0.1
"""Largest difference of a joint's command and measurement with which an arm may be engaged [rad]."""

HELD_STILL = 0.1
"""How far an answer may move a joint of an arm that holds [rad]; beyond, the answer is not for this robot."""

_UNDER_WAY = frozenset({ArmState.ACTIVE, ArmState.HOLD})


class TeleopLoop:
    """Follows an operator's hands with a robot's arms through an IK service. One tick per call, paced by the caller.

    Attributes:
        session: Random name of this run, part of every command.
    """

    def __init__(
        self,
        ik: Kinematics,
        source: HandSource,
        port: RobotPort,
        limiter: Limiter,
        *,
        arms: tuple[ArmEngagement, ArmEngagement] | None = None,
        smoothing: WeightedMovingFilter | None = None,
        feed_forward: bool = False,
        collision: Collision | None = None,
        agreement: float = 0.3,
        period: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Put the parts together; nothing moves before a hand is engaged.

        Args:
            ik: An `IKClient`, or anything that solves like it. Its timeout should be shorter than a tick.
            source: The tracker.
            port: The robot. The first half of its joints is the left arm, the second the right.
            limiter: Bounds the way from one command to the next.
            arms: How the left and the right hand engage; None for the defaults: gate, hold-to-run grip and a clutch
                relative to where the hand was gripped.
            smoothing: Filter over the answers, in front of the limiter.
            feed_forward: Send the gravity torque along with the joints; else the torque is zero.
            collision: What to do about self-collision, as in `IKClient.solve`; None takes the service's default.
            agreement: Largest difference of a joint's command and measurement with which the command still counts as
                where the arm is [rad].
            period: Time of the robot from one command to the next, where it is not that of the clock, as in a
                simulation that advances by a tick for each command [s]; None for the clock's.
            clock: Monotonic time [s].
        """
        self.session = secrets.token_hex(6)
        self._ik = ik
        self._source = source
        self._port = port
        self._limiter = limiter
        self._arms = arms or (ArmEngagement(), ArmEngagement())
        self._smoothing = smoothing
        self._feed_forward = feed_forward
        self._torque = RestingTorque(ik) if feed_forward else None
        self._collision: Collision | None = collision
        self._agreement = agreement
        self._period = period
        self._clock = clock
        self._service = ServiceWatch()
        self._robot = RobotWatch()
        self._wrists = RestingWrists(self._fk)
        self._waist = SteadyWaist()
        checks = isinstance(limiter, JointLimiter) and collision in (None, "avoid")
        self._way = ClearWay(limiter, self._clearance) if checks else None
        self._last: Command | None = None
        self._rests = False
        self._fault = ""
        self._clear = False

    @property
    def states(self) -> tuple[ArmState, ArmState]:
        """State of the left and of the right arm."""
        left, right = self._arms
        return left.state, right.state

    @property
    def rests(self) -> bool:
        """Whether the last tick changed nothing of the command: the arms stand, and their torque has arrived."""
        return self._rests

    def stop(self, reason: str = "stopped") -> None:
        """Disarm both arms. The states have changed when this returns; the next tick brakes and tells the robot.

        Args:
            reason: Why, in one line.
        """
        now = self._clock()
        for arm in self._arms:
            arm.stop(now, reason)

    def fault(self, reason: str) -> None:
        """Disarm both arms in the next tick, until a person has looked and `clear` is called.

        Args:
            reason: What is wrong, in one line.
        """
        self._fault = reason

    def clear(self) -> None:
        """Say that a person has looked at the fault. Following again takes a new grip."""
        self._fault, self._clear = "", True

    def release(self) -> None:
        """Disarm, and tell the robot to take its arms back: the last thing a loop does, and only on purpose."""
        self.stop("released")
        if self._last is not None:
            self._send(self._last.q, self._last.tau, self._clock(), release=True)

    def tick(self) -> TickReport:
        """Read, judge the hands, solve, limit, send.

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
        self._look_at_hands(tick)
        steps = self._judge(tick, last)
        goal, tau = self._goal(tick, steps, last)
        tracking = goal is not None
        q_wanted = goal if goal is not None else resting_goal(tick.measured, last)
        q = self._move(tick, last, q_wanted) if tracking else None
        if q is None:
            tracking, q_wanted = False, q_wanted if not tracking else np.full(len(last.q), np.nan)
            q = self._limiter.limit(last.q, q_wanted, self._since(last, tick))
        held = [
            side
            for side, step in enumerate(steps)
            if not tracking or step.target is None or _stands_short(joints_of(side, len(q)), last.q, q, q_wanted)
        ]
        rest = self._resting_point(q)
        tau = torque_on_the_way(last.q, q, q_wanted, last.tau, tau)
        command = self._send(q, self._held_torque(tick, held, rest, last, tau), tick.time)
        self._rests = is_same(command, last)
        self._ask_torque(tick, held, rest)
        return tick.report(steps, command, tracking, _reason_of(steps))

    def _look_at_hands(self, tick: Tick) -> None:
        try:
            tick.hands = self._source.hands(tick.time) or NO_HANDS
        except Exception as error:  # a tracker's fault is a hand that is lost
            tick.note(error)

    def _judge(self, tick: Tick, last: Command) -> tuple[ArmStep, ArmStep]:
        """Take both arms a tick further."""
        trouble = self._robot.trouble() or self._service.trouble(tick.time)
        revoked = self._robot.revoked(tick.time) or self._service.revoked()
        clear, self._clear = self._clear, False

        def step(side: int, hand) -> ArmStep:
            return self._arms[side].step(
                hand,
                tick.time,
                wrist=lambda: self._wrists.at(self._resting_point(last.q), tick.waist)[side],
                aligned=tick.measured is not None and aligned(last.q, tick.measured.q, side, ALIGNMENT),
                trouble=trouble,
                revoked=revoked,
                fault=self._fault,
                clear=clear,
            )

        return step(0, tick.hands.left), step(1, tick.hands.right)

    def _goal(self, tick: Tick, steps: tuple[ArmStep, ArmStep], last: Command) -> tuple[Array | None, Array]:
        """Joints to go to, NaN for those that shall rest, or None where none can; and the torque there [N m]."""
        follows = [step.target is not None for step in steps]
        if not any(follows):
            if self._smoothing:
                self._smoothing.reset()
            self._look_for_service(tick, last)
            return None, last.tau
        try:
            return self._follow(tick, steps, last)
        except Exception as error:  # whatever goes wrong in a client, the robot must be told to hold in this very tick
            tick.note(error)
            return None, last.tau

    def _look_for_service(self, tick: Tick, last: Command) -> None:
        """Find out whether a service in trouble is back, while no arm asks it anything."""
        if self._service.trouble(tick.time):
            try:
                self._fk(last.q, None)
            except Exception as error:
                tick.note(error)

    def _follow(self, tick: Tick, steps: tuple[ArmStep, ArmStep], last: Command) -> tuple[Array, Array]:
        """The goal where an arm has a target; raises where the tick cannot follow."""
        n, measured = len(last.q), tick.measured
        if measured is None:
            raise Hold("the robot cannot be read")
        targets, rest = [step.target for step in steps], last.q
        if any(target is None for target in targets):
            rest = self._resting_point(last.q)
            held = self._wrists.at(rest, tick.waist)
            targets = [held[side] if target is None else target for side, target in enumerate(targets)]
        reply = tick.reply = self._solve(tick, targets, measured, last)
        try:
            if not reply.success:
                raise Hold(f"{reply.status}: {reply.error}")
            q = usable(reply.sol_q, n, "the answer")
            tau = usable(reply.tau, n, "the answer's torque") if self._feed_forward else np.zeros(n)
        except Hold as hold:
            self._service.failed(str(hold), tick.time)
            raise
        self._service.succeeded()
        if self._smoothing:
            q = self._smoothing(q)
        goal, torque = np.full(n, np.nan), last.tau.copy()
        for side, step in enumerate(steps):
            arm = joints_of(side, n)
            if step.target is not None:
                goal[arm], torque[arm] = q[arm], tau[arm]
            elif np.max(np.abs(q[arm] - rest[arm])) > HELD_STILL:
                raise Hold(f"the {SIDES[side]} arm, which holds, is in the way")
        return goal, torque

    def _solve(self, tick: Tick, targets: list, measured: RobotState, last: Command) -> SolveReply:
        agrees = bool(np.all(np.abs(last.q - measured.q) <= self._agreement))
        tick.seed = Seed.COMMAND if agrees else Seed.MEASURED
        begin = self._clock()
        try:
            return self._heard(
                lambda: self._ik.solve(
                    targets[0],
                    targets[1],
                    last.q if agrees else measured.q,
                    measured.dq,
                    waist=tick.waist,
                    left_elbow=tick.hands.left_elbow,
                    right_elbow=tick.hands.right_elbow,
                    weights=tick.hands.weights,
                    collision=self._collision,
                )
            )
        finally:
            tick.round_trip = self._clock() - begin

    def _fk(self, q: Array, waist: Array | None) -> FkReply:
        reply = self._heard(lambda: self._ik.fk(q, waist))
        self._service.heard(engaged=self._under_way)
        return reply

    def _heard(self, ask: Callable[[], R]) -> R:
        """Ask the service something, and take note of how that went."""
        try:
            reply = ask()
        except Exception as error:
            self._service.failed(one_line(error), self._clock(), silent=is_silence(error))
            raise
        self._same_run(reply.boot_id)
        return reply

    @property
    def _under_way(self) -> bool:
        """Whether an arm follows, or may go on without another grip."""
        return any(arm.state in _UNDER_WAY for arm in self._arms)

    def _same_run(self, boot_id: str) -> None:
        """Refuse an answer of another run of the service than the one an arm has followed so far."""
        if not self._service.answered(boot_id, engaged=self._under_way):
            raise Hold("another run of the service answers now")

    def _resting_point(self, q: Array) -> Array:
        """Where the joints come to rest if they brake from a command on, shape (n,) [rad]."""
        rest = self._limiter.resting_point
        return rest if rest.shape == q.shape and np.isfinite(rest).all() else q

    def _held_torque(self, tick: Tick, held: list[int], rest: Array, last: Command, tau: Array) -> Array:
        """A tick's torque, with that of arms that hold on its way to the torque of where they rest, if it is known."""
        for arm in (joints_of(side, len(rest)) for side in held):
            if self._torque is not None and self._torque.knows(rest, tick.waist, arm):
                tau[arm] = self._torque.towards(last.tau, self._since(last, tick), arm)
        return tau

    def _ask_torque(self, tick: Tick, held: list[int], rest: Array) -> None:
        """Ask for the torque of where arms that hold will rest, where it is not known and the service answers."""
        if self._torque is None or not self._service.answers or not self._torque.due(tick.time):
            return
        if all(self._torque.knows(rest, tick.waist, joints_of(side, len(rest))) for side in held):
            return
        # Why the arms hold is told already, and the torque stays as it was.
        with contextlib.suppress(Exception):
            self._same_run(self._torque.ask(rest, tick.waist, tick.time))

    def _since(self, last: Command, tick: Tick) -> float:
        """Time since the last command, as the robot counts it [s]."""
        return self._period or tick.time - last.time

    def _move(self, tick: Tick, last: Command, q_wanted: Array) -> Array | None:
        """The step towards a goal; None where it cannot be told whether it is clear of the body."""
        if self._way is None:
            return self._limiter.limit(last.q, q_wanted, self._since(last, tick))
        waist = tick.measured.waist if tick.measured else None
        try:
            return self._way.step(last.q, q_wanted, self._since(last, tick), waist)
        except Exception as error:
            tick.note(error)
            return None

    def _clearance(self, q: Array, waist: Array | None) -> Array:
        """Smallest distance between two parts of the body at each row of joints [m]."""
        reply = self._heard(lambda: self._ik.clearance(q, waist))
        return np.full(len(q), np.inf) if reply.clearance is None else reply.clearance

    def _send(self, q: Array, tau: Array, now: float, release: bool = False) -> Command:
        command = Command(
            frozen(np.array(q)),
            frozen(np.array(tau)),
            now,
            session=self.session,
            seq=self._last.seq + 1 if self._last else 1,
            boot_id=self._service.boot_id,
            engaged=self._under_way,
            release=release,
        )
        self._last = command
        self._port.send(command)
        return command


def _stands_short(arm: slice, q_last: Array, q: Array, q_wanted: Array) -> bool:
    """Whether an arm stands without being where it is wanted: the way is not clear."""
    way, step = (float(np.abs(to[arm] - q_last[arm]).max()) for to in (q_wanted, q))
    return way > KNOWN_WITHIN and step <= NO_STEP


def _reason_of(steps: tuple[ArmStep, ArmStep]) -> str:
    left, right = (step.reason for step in steps)
    return left if left == right else "; ".join(f"{s}: {r}" for s, r in zip(SIDES, (left, right), strict=True) if r)
