"""The limiter: every joint's velocity, acceleration and jerk stay within bounds, whatever is wanted. The last link.

- Everything is relative to the last command, not to the measured joints: a lagging arm does not slow the command down.
- Each joint is on the time-optimal way to its goal, computed anew every tick. A goal that moves is met at its own
  speed, in the frame that moves with it: else a joint would lag behind by the way it needs to stop. One that stands
  still, or leaps, is met at rest.
- A joint whose goal is not finite brakes and holds. So holding is a goal like any other: no numbers at all.
- With position limits, goals are clipped to them less an inset, and no joint overshoots it by more than the planner's
  precision of 1e-7 rad: where one could not stop before it, all meet their goals at rest. A command that starts outside
  moves inward only.
- Where no plan can be computed the last one is continued if it ends at rest, else the joints brake.

The time-optimal ways are those of ruckig (extra `teleop`), which is loaded when the first limiter is made. For
OpenWBT's own clip of 0.01 rad per control tick, take `StepLimiter`.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ik_client.braking import stopping_points
from ik_client.moving_goal import MovingGoal
from ik_proto import Array

if TYPE_CHECKING:
    import ruckig

_FAR = 1e3
"""A goal further away than this is as far [rad]: numbers without bound would leave the arithmetic."""

_NEARER_AT_LEAST = 0.01
"""How fast a joint may come nearer to a moving goal, however near it is [rad/s]."""

_MEETABLE = 0.95
"""Fraction of the velocity limit up to which a moving goal is met: catching up needs some to spare."""

RANGE_INSET = 0.05
"""How far within its position limits a joint is kept [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionLimits:
    """Bounds of the commanded motion: one number for all joints, or one for each.

    Attributes:
        velocity: Largest velocity [rad/s].
        acceleration: Largest acceleration [rad/s^2].
        jerk: Largest jerk [rad/s^3]. With the default the full acceleration is reached in 20 ms.
    """

    velocity: float | Array = 3.0
    acceleration: float | Array = 20.0
    jerk: float | Array = 1000.0


@dataclass(frozen=True, slots=True, eq=False)
class Saved:
    """A state of a limiter.

    Attributes:
        q: Where the joints are, shape (n,) [rad].
        velocity: How they move, shape (n,) [rad/s].
        acceleration: How that changes, shape (n,) [rad/s^2].
        goals: The goals of the last ticks, oldest first.
    """

    q: Array
    velocity: Array
    acceleration: Array
    goals: tuple[Array, ...]


class JointLimiter:
    """Moves a command towards where it is wanted, within bounds. Fits `TeleopLoop`'s `Limiter`.

    Attributes:
        period: Time between two commands [s].
    """

    def __init__(
        self,
        n: int,
        period: float,
        limits: MotionLimits | None = None,
        *,
        lower: Array | None = None,
        upper: Array | None = None,
        inset: float = RANGE_INSET,
    ) -> None:
        """Set the bounds; the first command is where it starts, at rest.

        Args:
            n: Number of joints.
            period: Time between two commands [s].
            limits: Bounds of the motion.
            lower: Lower joint limits, shape (n,) [rad]; None for no limits.
            upper: Upper joint limits, shape (n,) [rad]; None for no limits.
            inset: How far within its limits a joint is kept [rad].

        Raises:
            ImportError: ruckig is not installed.
            ValueError: A bound is not positive and finite, or limits and inset leave a joint no range.
        """
        try:
            import ruckig
        except ImportError as error:
            raise ImportError("the joint limiter needs ruckig: pip install 'ik-service[teleop]'") from error
        limits = limits or MotionLimits()
        self.period = float(_positive(period, "period", 1)[0])
        velocity = _positive(limits.velocity, "velocity", n)
        acceleration = _positive(limits.acceleration, "acceleration", n)
        jerk = _positive(limits.jerk, "jerk", n)
        self._lower = np.full(n, -np.inf) if lower is None else np.asarray(lower) + inset
        self._upper = np.full(n, np.inf) if upper is None else np.asarray(upper) - inset
        if not (self._lower <= self._upper).all():
            raise ValueError(f"joint limits less an inset of {inset:g} rad leave a joint no range")
        # How far a joint gets in a few ticks and a stop after them. A goal beyond changes nothing in this tick, and
        # would only cost the planner its precision.
        self._horizon = velocity * (4.0 * self.period + velocity / acceleration + 2.0 * acceleration / jerk)

        self._velocity_limit, self._acceleration_limit, self._jerk_limit = velocity, acceleration, jerk
        self._moving_goal = MovingGoal(self.period, _MEETABLE * velocity)

        self._planner = ruckig.Ruckig(n)
        self._error = ruckig.RuckigError
        self._to_position = ruckig.ControlInterface.Position
        self._to_rest = ruckig.ControlInterface.Velocity
        self._plan, self._spare = ruckig.Trajectory(n), ruckig.Trajectory(n)
        self._input = ruckig.InputParameter(n)
        self._input.synchronization = ruckig.Synchronization.No
        self._input.max_acceleration = acceleration.tolist()
        self._input.max_jerk = jerk.tolist()
        self._restart(np.full(n, np.nan))  # No command yet: whatever comes first is a start.

    @property
    def velocity(self) -> Array:
        """Velocity of the last command, shape (n,) [rad/s]."""
        return self._velocity.copy()

    @property
    def acceleration(self) -> Array:
        """Acceleration of the last command, shape (n,) [rad/s^2]."""
        return self._acceleration.copy()

    @property
    def resting_point(self) -> Array:
        """Where the joints come to rest if nothing else is wanted, shape (n,) [rad]; NaN before the first command."""
        return self.stop_path()[-1]

    def stop_path(self, most: int = 12) -> Array:
        """Where the joints are at the following ticks if they brake from here on; the last row is the resting point.

        Args:
            most: Largest number of rows; where the stop takes more ticks, they are spread over it evenly.

        Returns:
            Positions, shape (k, n) [rad], k from 1 to `most`.
        """
        if not self._compute(self._q, np.zeros(len(self._q)), np.ones(len(self._q), dtype=bool)):
            return self._q[None].copy()
        count = math.ceil(self._spare.duration / self.period)
        spacing = self.period if count <= most else self._spare.duration / most
        return np.array([self._spare.at_time(k * spacing)[0] for k in range(1, max(1, min(count, most)) + 1)])

    def save(self) -> "Saved":
        """Keep the present state, to come back to."""
        return Saved(self._q, self._velocity, self._acceleration, self._moving_goal.past)

    def restore(self, saved: "Saved") -> None:
        """Come back to a state: what was limited since then did not happen."""
        self.resume(saved.q, saved.velocity, saved.acceleration)
        self._moving_goal.past = saved.goals

    def limit(self, q_last: Array, q_wanted: Array, dt: float | None = None, haste: float | Array = 1.0) -> Array:
        """Move from the last command towards the wanted joints.

        Args:
            q_last: Last command, shape (n,) [rad], finite. Anything but what the call before returned is a new start,
                at rest.
            q_wanted: Where to go, shape (n,) [rad]; a joint without a finite goal brakes and holds.
            dt: Time since the last command [s], taken as within half a period and two; None for a period.
            haste: Fraction of the velocity limits to use, above 0 to 1: one number, or one for each joint. A joint that
                is faster slows down to it.

        Returns:
            The next command, shape (n,) [rad], finite. A new array.

        Raises:
            ValueError: The last command is not n finite numbers.
        """
        self._begin(q_last)
        self._haste = haste
        step = interval(dt, self.period)
        if not (self._meet(q_wanted, step) or self._go_on(step)):
            self._brake(step)
        return self._q.copy()

    def move(self, q_last: Array, velocity: Array, dt: float | None = None) -> Array:
        """Move from the last command at wanted velocities, each kept for a whole tick.

        What is wanted is taken exactly where it keeps the bounds of velocity and acceleration, as differences of
        commands: so joints that are led together stay together. Jerk is as it is wanted.

        Args:
            q_last: Last command, as in `limit`.
            velocity: How the joints shall move, shape (n,) [rad/s]; one without a finite velocity brakes and holds. One
                that nears its limit is slowed so that it can stop there.
            dt: Time since the last command, as in `limit` [s].

        Returns:
            The next command, shape (n,) [rad], finite. A new array.

        Raises:
            ValueError: The last command is not n finite numbers.
        """
        self._begin(q_last)
        step, most = interval(dt, self.period), self._acceleration_limit
        wanted = np.where(np.isfinite(velocity), velocity, 0.0)
        wanted = np.clip(wanted, -self._velocity_limit, self._velocity_limit)
        above = _stoppable(self._upper - self._q, most, step)
        below = _stoppable(self._q - self._lower, most, step)
        wanted = np.maximum(np.minimum(wanted, above), -below)
        # The acceleration last: a joint that begins beyond its limit is not thrown back.
        v = np.clip(wanted, self._velocity - most * step, self._velocity + most * step)
        self.resume(self._q + v * step, v, np.zeros(len(v)))
        self._moving_goal.forget()
        return self._q.copy()

    def resume(self, q: Array, velocity: Array, acceleration: Array) -> None:
        """Take over a motion that something else has brought here: `limit` goes on from it.

        Args:
            q: Where the joints are, shape (n,) [rad], finite.
            velocity: How they move, shape (n,) [rad/s].
            acceleration: How that changes, shape (n,) [rad/s^2].
        """
        self._q, self._velocity, self._acceleration = np.array(q), np.array(velocity), np.array(acceleration)
        self._planned = False

    def _begin(self, q_last: Array) -> None:
        """Go on from the last command, or start anew where it is not ours."""
        if np.array_equal(q_last, self._q):
            return
        if np.shape(q_last) != self._q.shape or not np.isfinite(q_last).all():
            raise ValueError(f"the last command must be {len(self._q)} finite numbers and is not")
        self._restart(q_last)

    def _restart(self, q: Array) -> None:
        self._q = np.array(q, dtype=np.float64)
        self._velocity = np.zeros(len(self._q))
        self._acceleration = np.zeros(len(self._q))
        self._moving_goal.forget()
        self._age = 0.0
        self._ends_at_rest = True
        self._planned = False
        self._haste = 1.0

    def _meet(self, q_wanted: Array, step: float) -> bool:
        """Take a step towards the wanted joints; False where there is no plan for it."""
        brakes = ~np.isfinite(q_wanted)
        wanted = np.where(brakes, self._q, np.clip(q_wanted, self._q - _FAR, self._q + _FAR))
        wanted = np.clip(wanted, self._lower, self._upper)
        goal = np.clip(wanted, self._q - self._horizon, self._q + self._horizon)
        drift = self._moving_goal.speed(np.where(brakes, np.nan, wanted))
        meetable = _MEETABLE * self._haste * self._velocity_limit
        drift = np.clip(drift, -meetable, meetable)
        # A goal is where the joint shall be at the end of this step.
        if drift.any() and self._compute(goal - drift * step, drift, brakes):
            q, velocity, acceleration = self._at(self._spare, step, drift)
            low, high = stopping_points(q, velocity, acceleration, self._acceleration_limit, self._jerk_limit)
            if (low >= self._lower).all() and (high <= self._upper).all():
                self._take(q, velocity, acceleration, step, ends_at_rest=False)
                return True
        still = np.zeros(len(goal))
        if not self._compute(goal, still, brakes):
            return False
        self._take(*self._at(self._spare, step, still), step, ends_at_rest=True)
        return True

    def _go_on(self, step: float) -> bool:
        """Continue the last plan; False where there is none, or it ends with a goal that moves on."""
        if not (self._planned and self._ends_at_rest):
            return False
        self._age += step
        self._q, self._velocity, self._acceleration = self._at(self._plan, self._age, np.zeros(len(self._q)))
        return True

    def _brake(self, step: float) -> None:
        """Slow down at full acceleration, without regard to the jerk: what is left when planning fails."""
        slower = np.maximum(np.abs(self._velocity) - self._acceleration_limit * step, 0.0) * np.sign(self._velocity)
        self._q = self._q + 0.5 * step * (self._velocity + slower)
        self._velocity, self._acceleration = slower, np.zeros(len(slower))

    def _take(self, q: Array, velocity: Array, acceleration: Array, step: float, ends_at_rest: bool) -> None:
        self._q, self._velocity, self._acceleration = q, velocity, acceleration
        self._plan, self._spare = self._spare, self._plan
        self._planned, self._age, self._ends_at_rest = True, step, ends_at_rest

    def _compute(self, goal: Array, drift: Array, brakes: Array) -> bool:
        """Compute the plan from where the joints are into the spare trajectory, in the frame that moves with the goal.

        Args:
            goal: Where the goal is when the plan begins, shape (n,) [rad].
            drift: Velocity of the goal and of the frame, shape (n,) [rad/s]. Velocities in the frame are less by it, so
                their bounds are not symmetrical.
            brakes: Which joints have no goal and come to rest, shape (n,).
        """
        plan = self._input
        plan.current_position = self._q.tolist()
        plan.current_velocity = (self._velocity - drift).tolist()
        plan.current_acceleration = self._acceleration.tolist()
        plan.target_position = goal.tolist()
        fastest, slowest = self._catching_up(goal - self._q, drift)
        plan.max_velocity = fastest.tolist()
        plan.min_velocity = slowest.tolist()
        plan.per_dof_control_interface = [self._to_rest if brake else self._to_position for brake in brakes.tolist()]
        try:
            return self._planner.calculate(plan, self._spare) >= 0
        except (self._error, ValueError):  # the latter for results that its Python side has no name for
            return False

    def _catching_up(self, gap: Array, drift: Array) -> tuple[Array, Array]:
        """Bounds of the velocity in the frame that moves with the goal, shape (n,) each [rad/s].

        A goal that stops brakes as hard as the joint can. So a joint that is behind comes nearer only as fast as leaves
        something of the gap at the end of such a stop, else it would be carried past the goal and swing back.
        """
        limit = self._haste * self._velocity_limit
        stop = np.abs(drift) / self._acceleration_limit + self._acceleration_limit / self._jerk_limit
        nearer = np.abs(gap) / stop + _NEARER_AT_LEAST
        moving = drift != 0.0
        fastest = np.where(moving & (gap > 0.0), np.minimum(limit - drift, nearer), limit - drift)
        slowest = np.where(moving & (gap < 0.0), np.maximum(-limit - drift, -nearer), -limit - drift)
        return fastest, slowest

    def _at(self, plan: "ruckig.Trajectory", time: float, drift: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations of a plan, out of its moving frame."""
        q, velocity, acceleration = plan.at_time(time)
        return np.array(q) + drift * time, np.array(velocity) + drift, np.array(acceleration)


def _stoppable(room: Array, acceleration: Array, step: float) -> Array:
    """Largest velocity that may be kept for a tick before braking evenly within some room, shape (n,) [rad/s].

    The v of v T + v^2 / (2 a) = d; none where there is no room.
    """
    return acceleration * (np.sqrt(step**2 + 2.0 * np.maximum(room, 0.0) / acceleration) - step)


def interval(dt: float | None, period: float) -> float:
    """The time a tick counts for.

    Args:
        dt: Time since the last tick [s]; None for a period.
        period: The ordinary time between two ticks [s].

    Returns:
        The time, within half a period and two; NaN counts as the shortest [s].
    """
    if dt is None:
        return period
    return min(dt, 2.0 * period) if dt > 0.5 * period else 0.5 * period


def _positive(value: float | Array, what: str, n: int) -> Array:
    bounds = np.broadcast_to(np.asarray(value, dtype=np.float64), n)
    if not (np.isfinite(bounds).all() and (bounds > 0.0).all()):
        raise ValueError(f"{what} must be positive and finite, not {value}")
    return bounds
