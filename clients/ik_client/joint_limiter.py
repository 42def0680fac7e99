"""The limiter: every joint's velocity, acceleration and jerk stay within bounds, whatever is wanted. The last link.

- Everything is relative to the last command, not to the measured joints: a lagging arm does not slow the command down.
- Each joint is on the time-optimal way to rest at its goal, computed anew every tick.
- A joint whose goal is not finite brakes and holds. So holding is a goal like any other: no numbers at all.
- With position limits, goals are clipped to them less an inset, and no joint overshoots it by more than the planner's
  precision of 1e-7 rad. A command that starts outside moves inward only.
- Where no plan can be computed the last one is continued: every plan ends at rest.

The time-optimal ways are those of ruckig (extra `teleop`), which is loaded when the first limiter is made. For
OpenWBT's own clip of 0.01 rad per control tick, take `StepLimiter`.
"""

from dataclasses import dataclass

import numpy as np

from ik_proto import Array

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

        self._planner = ruckig.Ruckig(n)
        self._error = ruckig.RuckigError
        self._to_position = ruckig.ControlInterface.Position
        self._to_rest = ruckig.ControlInterface.Velocity
        self._plan, self._spare = ruckig.Trajectory(n), ruckig.Trajectory(n)
        self._input = ruckig.InputParameter(n)
        self._input.synchronization = ruckig.Synchronization.No
        self._input.max_velocity = velocity.tolist()
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
        return self._rest.copy()

    def limit(self, q_last: Array, q_wanted: Array, dt: float | None = None) -> Array:
        """Move from the last command towards the wanted joints.

        Args:
            q_last: Last command, shape (n,) [rad], finite. Anything but what the call before returned is a new start,
                at rest.
            q_wanted: Where to go, shape (n,) [rad]; a joint without a finite goal brakes and holds.
            dt: Time since the last command [s], taken as within half a period and two; None for a period.

        Returns:
            The next command, shape (n,) [rad], finite. A new array.

        Raises:
            ValueError: The last command is not n finite numbers.
        """
        if not np.array_equal(q_last, self._q):
            if np.shape(q_last) != self._q.shape or not np.isfinite(q_last).all():
                raise ValueError(f"the last command must be {len(self._q)} finite numbers and is not")
            self._restart(q_last)
        if self._replan(q_wanted):
            self._age = 0.0
        self._age += self._clamped(dt)
        if self._planned:
            q, velocity, acceleration = self._plan.at_time(self._age)
            self._q, self._velocity, self._acceleration = np.array(q), np.array(velocity), np.array(acceleration)
        return self._q.copy()

    def _restart(self, q: Array) -> None:
        self._q = np.array(q, dtype=np.float64)
        self._velocity = np.zeros(len(self._q))
        self._acceleration = np.zeros(len(self._q))
        self._rest = self._q.copy()
        self._age = 0.0
        self._planned = False

    def _clamped(self, dt: float | None) -> float:
        if dt is None:
            return self.period
        # In this order NaN takes the shortest step.
        return min(dt, 2.0 * self.period) if dt > 0.5 * self.period else 0.5 * self.period

    def _replan(self, q_wanted: Array) -> bool:
        """Plan the way to the wanted joints; False where that fails, and the last plan stays."""
        brakes = ~np.isfinite(q_wanted)
        reachable = np.clip(np.where(brakes, self._q, q_wanted), self._q - self._horizon, self._q + self._horizon)
        goal = np.clip(reachable, self._lower, self._upper)
        plan = self._input
        plan.current_position = self._q.tolist()
        plan.current_velocity = self._velocity.tolist()
        plan.current_acceleration = self._acceleration.tolist()
        plan.target_position = goal.tolist()
        plan.per_dof_control_interface = [self._to_rest if brake else self._to_position for brake in brakes.tolist()]
        try:
            failed = self._planner.calculate(plan, self._spare) < 0
        except self._error:
            failed = True
        if failed:
            return False
        self._plan, self._spare = self._spare, self._plan
        self._planned = True
        self._rest = np.array(self._plan.at_time(self._plan.duration)[0])
        return True


def _positive(value: float | Array, what: str, n: int) -> Array:
    bounds = np.broadcast_to(np.asarray(value, dtype=np.float64), n)
    if not (np.isfinite(bounds).all() and (bounds > 0.0).all()):
        raise ValueError(f"{what} must be positive and finite, not {value}")
    return bounds
