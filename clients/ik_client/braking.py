"""Where a joint comes to rest if it brakes now, its acceleration and jerk bounded."""

import numpy as np

from ik_proto import Array


def stopping_points(q: Array, velocity: Array, acceleration: Array, a_max: Array, j_max: Array) -> tuple[Array, Array]:
    """Lowest and highest point at which each joint may come to rest if it brakes now.

    A joint that accelerates away first takes its acceleration back, at full jerk; then it stops from v without any,
    which takes v / 2 (v / a + a / j) where v is at least a^2 / j, else v sqrt(v / j) (Biagiotti and Melchiorri,
    Trajectory Planning, 2008, 3.4). An acceleration that brakes already is not counted, so the true point is nearer.

    Args:
        q: Positions, shape (n,) [rad].
        velocity: Shape (n,) [rad/s].
        acceleration: Shape (n,) [rad/s^2].
        a_max: Largest acceleration, shape (n,) [rad/s^2].
        j_max: Largest jerk, shape (n,) [rad/s^3].

    Returns:
        Both, shape (n,) each [rad]; the joint's own place is between them.
    """
    low = q - _distance(-velocity, -acceleration, a_max, j_max)
    return low, q + _distance(velocity, acceleration, a_max, j_max)


def _distance(velocity: Array, acceleration: Array, a_max: Array, j_max: Array) -> Array:
    """How far a joint may get in the positive direction."""
    excess = np.clip(acceleration, 0.0, a_max)
    time = excess / j_max
    way = velocity * time + excess * time**2 / 2.0 - j_max * time**3 / 6.0
    fastest = np.maximum(velocity + excess * time / 2.0, 0.0)
    knee = a_max**2 / j_max
    stop = np.where(
        fastest >= knee,
        0.5 * fastest * (fastest / a_max + a_max / j_max),
        fastest * np.sqrt(fastest / j_max),
    )
    return np.maximum(way + stop, 0.0)
