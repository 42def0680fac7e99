"""The teleop loop: hands in, solve, limit, command out, once per tick.

Each arm has its own gate, grip, states and clutch (`engagement`); both share service and robot (`partners`), and the
limiter.

| situation                                              | the arm                                             |
|--------------------------------------------------------|-----------------------------------------------------|
| active, answer usable                                  | a limited step towards the answer                   |
| active, any error, no success, an unusable answer      | brakes within its limits in this tick, then goes on |
| service or robot in trouble for longer than a moment   | holds, then disarms: see `state_machine`            |
| another run of the service answers, the robot lets go  | disarms at once: going on takes a new grip          |
| any other state                                        | brakes within its limits and holds                  |

- A command goes to the robot every tick, whatever happens. Before any grip it is where the robot's end holds its joints
  or, where it does not say, the joints measured first. It never goes home by itself.
- Both arms are asked about at once (`arm_goals`), one that holds for where it is. Where collisions are avoided, each
  step towards the answer, and the stop from it, are clear of the body (`clear_way`).
- The feed-forward torque advances by the same fraction of its way as the joints of its arm. That of an arm that holds
  goes evenly to the torque of where it rests, asked for when the command of a tick is on its way (`resting_torque`).
- Only a first tick that cannot read the robot raises: there is nothing to hold yet.

This is not a safety function; the robot side keeps its own watchdog and limiter.
"""

import time
from collections.abc import Callable

import numpy as np

from ik_client.arm_goals import ArmGoals
from ik_client.arm_joints import SIDES, aligned, joints_of, torque_on_the_way
from ik_client.clear_way import ClearWay
from ik_client.engagement import ArmEngagement, ArmStep
from ik_client.hand import HandSample
from ik_client.joint_limiter import JointLimiter
from ik_client.partners import ALIGNMENT, UNDER_WAY, Partners
from ik_client.resting_torque import KNOWN_WITHIN, RestingTorque
from ik_client.state_machine import ArmState
from ik_client.tick import NO_HANDS, NO_STEP, Tick, resting_goal
from ik_client.tick_report import TickReport
from ik_client.types import Command, HandSource, Kinematics, Limiter, RobotPort
from ik_proto import Array, Collision
from ik_proto.smoothing import WeightedMovingFilter


class TeleopLoop:
    """Follows an operator's hands with a robot's arms through an IK service. One tick per call, paced by the caller."""

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
        self._source = source
        self._limiter = limiter
        self._arms = arms or (ArmEngagement(), ArmEngagement())
        self._period = period
        self._clock = clock
        partners = self._partners = Partners(ik, port, lambda: any(s in UNDER_WAY for s in self.states), clock)
        checks = isinstance(limiter, JointLimiter) and collision in (None, "avoid")
        self._goals = ArmGoals(
            ik,
            partners,
            smoothing=smoothing,
            feed_forward=feed_forward,
            collision=collision,
            agreement=agreement,
            ways_out=checks,
        )
        self._torque = RestingTorque(ik, partners) if feed_forward else None
        self._way = ClearWay(limiter, partners.clearance) if checks else None
        self._fault = ""
        self._clear = False

    @property
    def session(self) -> str:
        """Random name of this run, part of every command."""
        return self._partners.session

    @property
    def states(self) -> tuple[ArmState, ArmState]:
        """State of the left and of the right arm."""
        left, right = self._arms
        return left.state, right.state

    @property
    def rests(self) -> bool:
        """Whether the last tick changed nothing of the command: the arms stand, and their torque has arrived."""
        return self._partners.same

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
        self._partners.release()

    def tick(self) -> TickReport:
        """Read, judge the hands, solve, limit, send.

        Returns:
            What was done and why.

        Raises:
            Exception: The robot could not be read in the very first tick, or could not be sent a command in this one.
        """
        tick, last = self._partners.begin()
        self._look_at_hands(tick)
        steps = self._judge(tick, last)
        goal, tau = self._goal(tick, steps, last)
        q = None if goal is None else self._move(tick, last, goal)
        tracking = q is not None
        if q is None:
            goal = resting_goal(tick.measured, last) if goal is None else np.full(len(last.q), np.nan)
            q = self._limiter.limit(last.q, goal, self._since(tick, last))
        assert goal is not None
        tau = torque_on_the_way(last.q, q, goal, last.tau, tau)
        arms = [joints_of(side, len(q)) for side in (0, 1)]
        held = [
            arm
            for arm, step in zip(arms, steps, strict=True)
            if not tracking or step.target is None or _stands_short(last.q[arm], q[arm], goal[arm])
        ]
        command = self._send(tick, last, q, tau, held)
        self._goals.look_for_ways_out(tick)
        return tick.report(steps, command, tracking, _reason_of(steps))

    def _look_at_hands(self, tick: Tick) -> None:
        try:
            tick.hands = self._source.hands(tick.time) or NO_HANDS
        except Exception as error:  # a tracker's fault is a hand that is lost
            tick.note(error)

    def _judge(self, tick: Tick, last: Command) -> tuple[ArmStep, ArmStep]:
        """Take both arms a tick further."""
        trouble, revoked = self._partners.trouble(tick.time), self._partners.revoked(tick.time)
        clear, self._clear = self._clear, False

        def step(side: int, hand: HandSample | None) -> ArmStep:
            return self._arms[side].step(
                hand,
                tick.time,
                wrist=lambda: self._goals.wrist(side, self._resting_point(last.q), tick.waist),
                aligned=tick.measured is not None and aligned(last.q, tick.measured.q, side, ALIGNMENT),
                trouble=trouble,
                revoked=revoked,
                fault=self._fault,
                clear=clear,
            )

        return step(0, tick.hands.left), step(1, tick.hands.right)

    def _goal(self, tick: Tick, steps: tuple[ArmStep, ArmStep], last: Command) -> tuple[Array | None, Array]:
        """Joints to go to, NaN for those that shall rest, or None where none can; and the torque there [N m]."""
        targets = [step.target for step in steps]
        try:
            if any(target is not None for target in targets):
                return self._goals.of(tick, targets, self._resting_point(last.q), last)
            self._goals.none(tick, last)
        except Exception as error:  # whatever goes wrong in a client, the robot must be told to hold in this very tick
            tick.note(error)
        return None, last.tau

    def _move(self, tick: Tick, last: Command, goal: Array) -> Array | None:
        """The step towards a goal; None where it cannot be told whether it is clear of the body."""
        if self._way is None:
            return self._limiter.limit(last.q, goal, self._since(tick, last))
        waist = tick.measured.waist if tick.measured else None
        try:
            return self._way.step(last.q, goal, self._since(tick, last), waist)
        except Exception as error:
            tick.note(error)
            return None

    def _send(self, tick: Tick, last: Command, q: Array, tau: Array, held: list[slice]) -> Command:
        """Send the command, with arms that hold on their way to the torque of where they rest; then ask for that."""
        if self._torque is None:
            return self._partners.send(q, tau, tick.time)
        rest = self._resting_point(q)
        tau = self._torque.with_held(held, rest, tick.waist, tau, last.tau, self._since(tick, last))
        command = self._partners.send(q, tau, tick.time)
        self._torque.look(held, rest, tick.waist, tick.time)
        return command

    def _resting_point(self, q: Array) -> Array:
        """Where the joints come to rest if they brake from a command on, shape (n,) [rad]."""
        rest = self._limiter.resting_point
        return rest if rest.shape == q.shape and np.isfinite(rest).all() else q

    def _since(self, tick: Tick, last: Command) -> float:
        """Time since the last command, as the robot counts it [s]."""
        return self._period or tick.time - last.time


def _stands_short(q_last: Array, q: Array, goal: Array) -> bool:
    """Whether an arm stands without being where it is wanted: the way is not clear."""
    way, step = (float(np.abs(to - q_last).max()) for to in (goal, q))
    return way > KNOWN_WITHIN and step <= NO_STEP


def _reason_of(steps: tuple[ArmStep, ArmStep]) -> str:
    left, right = (step.reason for step in steps)
    return left if left == right else "; ".join(f"{s}: {r}" for s, r in zip(SIDES, (left, right), strict=True) if r)
