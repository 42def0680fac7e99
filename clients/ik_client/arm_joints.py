"""Which joints are whose: the first half of a joint vector is the left arm, the second half the right."""

import numpy as np

from ik_proto import Array

SIDES = ("left", "right")


def joints_of(side: int, n: int) -> slice:
    """The joints of an arm.

    Args:
        side: 0 for the left, 1 for the right.
        n: Number of joints of both.
    """
    return slice(n // 2) if side == 0 else slice(n // 2, n)


def aligned(q: Array, q_measured: Array, side: int, within: float) -> bool:
    """Whether an arm is where it is commanded to be.

    Args:
        q: Commanded joints, shape (n,) [rad].
        q_measured: Measured joints, shape (n,) [rad].
        side: 0 for the left arm, 1 for the right.
        within: Largest difference of a joint that counts as the same [rad].
    """
    arm = joints_of(side, len(q))
    return bool(np.all(np.abs(q[arm] - q_measured[arm]) <= within))


def torque_on_the_way(q_last: Array, q_next: Array, q_wanted: Array, tau_last: Array, tau_wanted: Array) -> Array:
    """The feed-forward torque of a limited step: of each arm, as far on its way as the joints are on theirs.

    Args:
        q_last: Last command, shape (n,) [rad].
        q_next: The limited step, shape (n,) [rad].
        q_wanted: Where to go, shape (n,) [rad]; an arm without finite goals comes to rest, and keeps its torque.
        tau_last: Torque of the last command, shape (n,) [N m].
        tau_wanted: Torque at the goal, shape (n,) [N m].

    Returns:
        The torque of this step, shape (n,) [N m].
    """
    tau = tau_last.copy()
    for side in (0, 1):
        arm = joints_of(side, len(q_last))
        way = float(np.max(np.abs(q_wanted[arm] - q_last[arm]), initial=0.0))
        if not np.isfinite(way):
            continue
        done = min(1.0, float(np.max(np.abs(q_next[arm] - q_last[arm]), initial=0.0)) / way) if way > 0.0 else 1.0
        tau[arm] = (1.0 - done) * tau_last[arm] + done * tau_wanted[arm]
    return tau
