"""The last limiter: what goes to the motors keeps its bounds, whatever was commanded.

- A joint's command that keeps velocity, acceleration and jerk relative to the last set-points, and from which the joint
  can stop within its position limits, is taken exactly as it is; after a command that was not, once the joint meets it
  at its own speed. Else a joint that catches up would be taken at a command it only passes, and would swing about it.
- Anything else is approached by `JointLimiter`: a command that is ahead, that jumps, or that is no number at all, with
  which the joint brakes and holds.
- Velocity and acceleration, as differences of the set-points, are within their bounds for every sequence of inputs, and
  set-points that begin within the position limits stay there. Jerk is within its bound too, except in a tick that
  changes between the two ways.

Everything is relative to the last set-point, not to the measured joints.
"""

import numpy as np
from numpy.typing import NDArray

from ik_client.braking import stopping_points
from ik_client.joint_limiter import JointLimiter, MotionLimits, interval
from ik_proto import Array

RANGE_INSET = 0.001
"""How far within its position limits a joint is kept [rad]: less than a loop keeps, so that its commands pass."""

_IN_STEP = 0.02
"""How far the velocities of a joint and of its command may differ where they meet, as a fraction of what full
acceleration makes of them in a tick."""

_TOLERANCE = 1e-6
"""Relative excess over a bound that still counts as keeping it: commands have passed through differences and text."""


class SetpointLimiter:
    """Moves a set-point with the commands, within bounds."""

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
        """Set the bounds.

        Args:
            n: Number of joints.
            period: Time between two set-points [s].
            limits: Bounds of the motion.
            lower: Lower joint limits, shape (n,) [rad]; None for no limits.
            upper: Upper joint limits, shape (n,) [rad]; None for no limits.
            inset: How far within its limits a joint is kept [rad].

        Raises:
            ImportError: ruckig is not installed.
            ValueError: A bound is not positive and finite, or limits and inset leave a joint no range.
        """
        limits = limits or MotionLimits()
        self._planner = JointLimiter(n, period, limits, lower=lower, upper=upper, inset=inset)
        self._period = period
        self._v_max = np.broadcast_to(np.asarray(limits.velocity, dtype=np.float64), n)
        self._a_max = np.broadcast_to(np.asarray(limits.acceleration, dtype=np.float64), n)
        self._j_max = np.broadcast_to(np.asarray(limits.jerk, dtype=np.float64), n)
        self._lower = np.full(n, -np.inf) if lower is None else np.asarray(lower) + inset
        self._upper = np.full(n, np.inf) if upper is None else np.asarray(upper) - inset
        self.start(np.zeros(n))

    @property
    def q(self) -> Array:
        """The last set-point, shape (n,) [rad]."""
        return self._q.copy()

    def start(self, q: Array) -> None:
        """Begin at rest.

        Args:
            q: Where, shape (n,) [rad], finite.
        """
        self._q = np.array(q, dtype=np.float64)
        self._wanted = self._q.copy()
        # Means over the last interval, by which commands are judged...
        self._mean_velocity = np.zeros(len(self._q))
        self._mean_acceleration = np.zeros(len(self._q))
        self._dt = self._period
        # ...and the state at its end, from which the planner goes on.
        self._velocity = np.zeros(len(self._q))
        self._acceleration = np.zeros(len(self._q))

    def step(self, q_wanted: Array, dt: float | None = None) -> Array:
        """Go on by a tick.

        Args:
            q_wanted: The command, shape (n,) [rad]; a joint without a finite one brakes and holds.
            dt: Time since the last set-point [s], taken as within half a period and two; None for a period.

        Returns:
            The set-point, shape (n,) [rad], finite. A new array.
        """
        dt = interval(dt, self._period)
        with np.errstate(invalid="ignore", over="ignore"):  # Commands may be anything; the comparisons refuse NaN.
            exact = self._keeps(np.asarray(q_wanted), dt)
        # Planned in any case: the planner learns from the commands how fast they move.
        self._planner.resume(self._q, self._velocity, self._acceleration)
        planned = self._planner.limit(self._q, q_wanted, dt)
        q = np.where(exact, q_wanted, planned)
        v, a = self._means(q, dt)
        velocity, acceleration = self._at_the_end(v, a, dt)
        self._velocity = np.where(exact, velocity, self._planner.velocity)
        self._acceleration = np.where(exact, acceleration, self._planner.acceleration)
        self._q, self._mean_velocity, self._mean_acceleration, self._dt = q, v, a, dt
        self._wanted = np.where(np.isfinite(q_wanted), q_wanted, q)
        return q.copy()

    def _means(self, q: Array, dt: float) -> tuple[Array, Array]:
        """Velocity [rad/s] and acceleration [rad/s^2] of a step, as differences of set-points, shape (n,) each."""
        v = (q - self._q) / dt
        return v, (v - self._mean_velocity) / (0.5 * (dt + self._dt))

    def _keeps(self, q: Array, dt: float) -> NDArray[np.bool_]:
        """Which joints may take their command as it is, shape (n,)."""
        v, a = self._means(q, dt)
        more = 1.0 + _TOLERANCE
        within = (np.abs(v) <= self._v_max * more) & (np.abs(a) <= self._a_max * more)
        within &= np.abs(a - self._mean_acceleration) <= self._j_max * more * dt
        command_velocity = (q - self._wanted) / dt
        within &= (self._q == self._wanted) | (np.abs(v - command_velocity) <= _IN_STEP * self._a_max * dt)
        velocity, acceleration = self._at_the_end(v, a, dt)
        low, high = self._stops(q, velocity, acceleration)
        rises, sinks = (v > 0.0) | (velocity > 0.0), (v < 0.0) | (velocity < 0.0)
        return within & (~rises | (high <= self._upper)) & (~sinks | (low >= self._lower))

    def _at_the_end(self, v: Array, a: Array, dt: float) -> tuple[Array, Array]:
        """The state with which a plan begins after a command that was taken as it is, shape (n,) each.

        A step's means are those of its middle; extrapolated to its end, a joint that has begun to brake does. The
        velocity may differ from the mean by what full acceleration makes of it in half a step: so the bound of the
        acceleration holds between the two. Of the acceleration only what brakes the joint counts, and no more than can
        fade before the joint turns back: so the plan exceeds no bound on its way.

        Returns:
            Velocity [rad/s] and acceleration [rad/s^2].
        """
        jerk = (a - self._mean_acceleration) / dt
        most = 0.5 * self._a_max * dt
        velocity = v + np.clip(0.5 * a * dt + 0.375 * jerk * dt**2, -most, most)
        velocity = np.clip(velocity, -self._v_max, self._v_max)
        braking = np.minimum(self._a_max, np.sqrt(2.0 * self._j_max * np.abs(velocity)))
        acceleration = a + jerk * dt
        return velocity, np.where(acceleration * velocity < 0.0, np.clip(acceleration, -braking, braking), 0.0)

    def _stops(self, q: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array]:
        """Lowest and highest point at which a plan that begins here may come to rest, shape (n,) each [rad].

        A stop that begins with some braking is the rest of one that began earlier, faster and with none.
        """
        direction, brake = np.sign(velocity), np.abs(acceleration)
        time = brake / self._j_max
        before = velocity + direction * 0.5 * brake * time
        q_before = q - before * time + direction * self._j_max * time**3 / 6.0
        return stopping_points(q_before, before, np.zeros(len(q)), self._a_max, self._j_max)
