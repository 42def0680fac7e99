"""The named workloads. How long a solve takes depends on its targets, so they are part of a measurement.

- `tracking`: both arms follow sums of five sinusoids a joint, 0.03 to 0.2 Hz, within 80 % of the joint limits; each
  solve starts from the solution before it. What teleoperation looks like.
- `random`: targets of joints drawn from 95 % of the limits; each solve starts from other such joints. Cold starts.
- `unreachable`: the directions of `tracking`, at 1.3 times the reach of the arms. Every solve ends on a limit.

The service itself tells limits, shoulders and reach, and where the wrists of given joints are; a seed decides the rest.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ik_proto import Array, FkReply, InfoReply

MOST_FRAMES = 2000
"""Frames of a workload; a longer run goes back and forth in it, so that a path stays a path."""

_SINUSOIDS = 5
_OVERREACH = 1.3


class Oracle(Protocol):
    """What a workload asks the service."""

    def info(self) -> InfoReply:
        """See `IKClient.info`."""
        ...

    def fk(self, q: Array) -> FkReply:
        """See `IKClient.fk`."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Workload:
    """Requests to make, in order.

    Attributes:
        name: Its name.
        left: Targets of the left wrist, shape (N, 4, 4) [m].
        right: Targets of the right wrist, shape (N, 4, 4) [m].
        q: Joints each solve starts from, shape (N, n) [rad].
        chained: Whether a solve starts from the solution before it instead, once there is one.
    """

    name: str
    left: Array
    right: Array
    q: Array
    chained: bool

    def frame(self, k: int) -> int:
        """Index of the k-th request's frame: back and forth, without repeating the ends."""
        last = len(self.q) - 1
        position = k % (2 * last) if last else 0
        return position if position <= last else 2 * last - position


def tracking(ik: Oracle, rng: np.random.Generator, rate: float, frames: int, progress: Callable[[], None]) -> Workload:
    """Make the workload `tracking`."""
    q = _sinusoids(ik.info(), rng, rate, frames)
    left, right = _wrists(ik, q, progress)
    return Workload("tracking", left, right, q, chained=True)


def cold(ik: Oracle, rng: np.random.Generator, rate: float, frames: int, progress: Callable[[], None]) -> Workload:  # noqa: ARG001
    """Make the workload `random`; the rate plays no part."""
    info = ik.info()
    middle, half = 0.5 * (info.upper + info.lower), 0.95 * 0.5 * (info.upper - info.lower)
    q_target, q_start = (middle + half * rng.uniform(-1.0, 1.0, (frames, len(middle))) for _ in range(2))
    left, right = _wrists(ik, q_target, progress)
    return Workload("random", left, right, q_start, chained=False)


def unreachable(
    ik: Oracle, rng: np.random.Generator, rate: float, frames: int, progress: Callable[[], None]
) -> Workload:
    """Make the workload `unreachable`."""
    info = ik.info()
    path = tracking(ik, rng, rate, frames, progress)
    for wrists, shoulder, reach in zip((path.left, path.right), info.shoulders, info.reach, strict=True):
        arm = wrists[:, :3, 3] - shoulder
        length = np.maximum(np.linalg.norm(arm, axis=1, keepdims=True), 1e-3 * reach)
        wrists[:, :3, 3] = shoulder + _OVERREACH * reach * arm / length
    return Workload("unreachable", path.left, path.right, path.q, chained=True)


WORKLOADS: dict[str, Callable[[Oracle, np.random.Generator, float, int, Callable[[], None]], Workload]] = {
    "tracking": tracking,
    "random": cold,
    "unreachable": unreachable,
}


def make_workload(
    name: str, ik: Oracle, *, seed: int, rate: float, frames: int, progress: Callable[[], None] = lambda: None
) -> Workload:
    """Make a workload by asking the service.

    Args:
        name: One of `WORKLOADS`.
        ik: A client of the service.
        seed: Decides all that is random: the same seed and robot give the same requests.
        rate: Requests per second of the client that will make them [Hz].
        frames: How many to prepare; at most `MOST_FRAMES` are.
        progress: Called once per frame.

    Returns:
        The workload.

    Raises:
        IKError: The service does not answer.
    """
    return WORKLOADS[name](ik, np.random.default_rng(seed), rate, min(max(frames, 1), MOST_FRAMES), progress)


def _sinusoids(info: InfoReply, rng: np.random.Generator, rate: float, frames: int) -> Array:
    """A smooth path of all joints within 80 % of their limits, shape (frames, n) [rad]."""
    n = len(info.lower)
    middle, half = 0.5 * (info.upper + info.lower), 0.8 * 0.5 * (info.upper - info.lower)
    frequency = rng.uniform(0.03, 0.2, (_SINUSOIDS, n))
    phase = rng.uniform(0.0, 2.0 * np.pi, (_SINUSOIDS, n))
    weight = rng.dirichlet(np.ones(_SINUSOIDS), n).T
    t = np.arange(frames)[:, None, None] / rate
    return middle + half * np.sum(weight * np.sin(2.0 * np.pi * frequency * t + phase), axis=1)


def _wrists(ik: Oracle, q: Array, progress: Callable[[], None]) -> tuple[Array, Array]:
    """Where the service says the wrists are, twice shape (N, 4, 4) [m]."""
    left, right = np.empty((len(q), 4, 4)), np.empty((len(q), 4, 4))
    for k, q_k in enumerate(q):
        reply = ik.fk(q_k)
        left[k], right[k] = reply.left_wrist, reply.right_wrist
        progress()
    return left, right
