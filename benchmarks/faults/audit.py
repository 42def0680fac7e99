"""Was anybody in danger? Looks at a run afterwards, from the robot's record and the operator's diary.

Nothing here asks the code under test what it thinks: bounds are differences of the recorded set-points, and what allows
motion are the grips that the operator wrote down.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.faults.plan import Fault, Kind
from benchmarks.faults.trace import Done, RobotTrace
from ik_client.joint_limiter import MotionLimits
from ik_client.robot_end.guard import DISARM_AFTER, HOLD_AFTER

ROUNDING = 1e-5
"""Relative excess over a bound that rounding makes."""

STILL = 1e-9
"""Change of a set-point in a tick that is none but rounding [rad]."""

BRAKING_S = 0.25
"""Longest way to rest from the largest velocity [s]: v/a + a/j, which is 0.17 s, and a few ticks."""

SETTLE_S = HOLD_AFTER + BRAKING_S
"""How long after a fault the arms may still move [s]: until it is noticed for certain, and they have braked."""

SURE_STOP_S = DISARM_AFTER + 0.3
"""A process stopped for longer disarms the arms for certain [s]."""

HEARD_S = 0.1
"""Time in which the robot's end has heard of a grip [s]."""

SAG_LIMIT = 0.02
"""How far a joint may hang below its set-point at rest [rad]."""


@dataclass
class Audit:
    """What was found.

    Attributes:
        velocity: Largest velocity of a set-point [rad/s].
        acceleration: Largest acceleration of a set-point [rad/s^2].
        step: Largest change of a set-point in a tick [rad].
        measured_velocity: Largest measured velocity of a joint while the set-points have full weight [rad/s].
        sag: Largest distance of a measured joint from its set-point, at rest and full weight [rad].
        lag: The same, in motion [rad].
        engagements: How often the robot began to follow.
        disarming: Faults after which it may not go on without a new grip.
        recovered: Faults after which it followed again.
        violations: What ought not to have happened, a line each.
    """

    velocity: float = 0.0
    acceleration: float = 0.0
    step: float = 0.0
    measured_velocity: float = 0.0
    sag: float = 0.0
    lag: float = 0.0
    engagements: int = 0
    disarming: int = 0
    recovered: int = 0
    violations: list[str] = field(default_factory=list)


def audit(trace: RobotTrace, done: Sequence[Done], grips: Sequence[float], limits: MotionLimits | None = None) -> Audit:
    """Look at a run.

    Args:
        trace: The robot's record.
        done: The faults, in order.
        grips: When the operator gripped [s].
        limits: Bounds of the robot's own end.

    Returns:
        What was found.
    """
    found = Audit()
    _bounds(trace, limits or MotionLimits(), found)
    _rest(trace, found)
    _engagements(trace, grips, found)
    for one in done:
        _after(trace, one, grips, found)
    _posture(trace, found)
    return found


def disarms(fault: Fault) -> bool:
    """Whether the arms may not go on after a fault without a new grip."""
    return fault.kind is not Kind.STOP or fault.lasts > SURE_STOP_S


def _bounds(trace: RobotTrace, limits: MotionLimits, found: Audit) -> None:
    """Velocity and acceleration, wherever two or three ticks in a row had a set-point."""
    change = np.diff(trace.q_set, axis=0)
    v = change / trace.dt[1:, None]
    a = np.diff(v, axis=0) / (0.5 * (trace.dt[2:] + trace.dt[1:-1]))[:, None]
    ours = trace.state != "released"
    two, three = ours[1:] & ours[:-1], ours[2:] & ours[1:-1] & ours[:-2]
    found.step = _largest(change[two])
    found.velocity = _largest(v[two])
    found.acceleration = _largest(a[three])
    for what, excess, where in (
        ("velocity", np.abs(v) - limits.velocity * (1.0 + ROUNDING), two),
        ("acceleration", np.abs(a) - limits.acceleration * (1.0 + ROUNDING), three),
    ):
        for k in np.flatnonzero((excess > 0.0).any(axis=1) & where):
            found.violations.append(f"{what} bound exceeded by {excess[k].max():.3g} at {trace.t[k + 1]:.3f} s")


def _rest(trace: RobotTrace, found: Audit) -> None:
    """Once braked, nothing moves but while following."""
    followed_at = np.maximum.accumulate(np.where(trace.following, trace.t, -np.inf))
    resting = trace.t - followed_at > BRAKING_S
    for k in np.flatnonzero(resting & (trace.moved > STILL)):
        found.violations.append(f"moved by {trace.moved[k]:.3g} rad while {trace.state[k]}, {trace.t[k]:.3f} s")


def _engagements(trace: RobotTrace, grips: Sequence[float], found: Audit) -> None:
    """Every time the robot begins to follow, it does so after a grip, or goes on after a moment's silence."""
    begins = np.flatnonzero(trace.following & ~np.roll(trace.following, 1))
    last_end = -np.inf
    for k in begins[begins > 0]:
        before = trace.state[k - 1]
        if before == "ready":
            found.engagements += 1
            ready_at = trace.t[_begin_of_state(trace, k - 1)]
            # The grip is noticed a few ticks later; it must not be older than the state that it ends. One that is given
            # while an arm holds begins that state: the arm aligns anew, and the robot's end hears of it.
            if not any(ready_at - HEARD_S <= grip <= trace.t[k] for grip in grips):
                found.violations.append(f"followed without a grip at {trace.t[k]:.3f} s")
        elif before != "holding" or trace.t[k] - last_end > DISARM_AFTER + 2.0 * trace.dt[k]:
            found.violations.append(f"followed from {before} at {trace.t[k]:.3f} s")
        ends = np.flatnonzero(~trace.following[k:])
        last_end = trace.t[k + ends[0]] if len(ends) else np.inf


def _begin_of_state(trace: RobotTrace, k: int) -> int:
    """The tick in which the state of tick k began."""
    changes = np.flatnonzero(trace.state[: k + 1] != trace.state[k])
    return int(changes[-1]) + 1 if len(changes) else 0


def _after(trace: RobotTrace, one: Done, grips: Sequence[float], found: Audit) -> None:
    """After a fault that disarms nothing moves until the operator grips anew."""
    found.recovered += bool(np.isfinite(one.recovered))
    if not np.isfinite(one.recovered):
        found.violations.append(f"the robot did not follow again after: {one.fault}, {one.t:.3f} s")
    if not disarms(one.fault):
        return
    found.disarming += 1
    regrip = min((grip for grip in grips if grip > one.t), default=np.inf)
    # A process that is asked to end answers a little longer; how long is not the arms' fault.
    settled = one.t + SETTLE_S + (DISARM_AFTER if one.fault.kind is Kind.TERM else 0.0)
    still = (trace.t > settled) & (trace.t < regrip)
    for k in np.flatnonzero(still & (trace.moved > STILL)):
        found.violations.append(f"moved {trace.moved[k]:.3g} rad after {one.fault} without a grip, {trace.t[k]:.3f} s")


def _posture(trace: RobotTrace, found: Audit) -> None:
    """Measured joints: near the set-points, at rest very near, and finite."""
    if not (np.isfinite(trace.q).all() and np.isfinite(trace.dq).all()):
        found.violations.append("a measured joint is not finite")
        return
    full = trace.weight >= 1.0
    off = np.abs(trace.q - trace.q_set).max(axis=1)
    moved_at = np.maximum.accumulate(np.where((trace.moved > STILL) | ~full, trace.t, -np.inf))
    resting = full & (trace.t - moved_at > BRAKING_S)
    found.measured_velocity = _largest(trace.dq[full])
    found.lag = _largest(off[full])
    found.sag = _largest(off[resting])
    if found.sag > SAG_LIMIT:
        found.violations.append(f"an arm hangs {found.sag:.3g} rad below its set-point at rest")


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values).max()) if values.size else 0.0
