"""Paths of postures, whose wrist poses are targets that can be reached, and how a solver follows them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.clips import folder
from benchmarks.limits.geometry import SelfDistances, wrists
from benchmarks.workloads import PERIOD
from ik_proto.smoothing import WeightedMovingFilter
from ik_service.problem import Collision
from ik_service.robot import Robot
from ik_service.solver import Solver

WAVES = 5
"""Sinusoids that a joint's motion is made of."""

LEAST_AMPLITUDE = 0.2
"""Share of the room to the limits below which a clear path is too small to count."""


@dataclass(frozen=True)
class JointPath:
    """A path and its targets.

    Attributes:
        name: Its name.
        q: Joint positions within the limits [rad], shape (N, nq).
        left: `T_base_wrist` of the left arm along it, shape (N, 4, 4).
        right: The same of the right arm.
        fps: Frames a second [Hz].
        inside: Whether the frame was within the limits before it was clipped to them, shape (N,).
    """

    name: str
    q: np.ndarray
    left: np.ndarray
    right: np.ndarray
    fps: float
    inside: np.ndarray

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.q)

    @classmethod
    def of(cls, robot: Robot, name: str, q: np.ndarray, fps: float = 1.0 / PERIOD) -> "JointPath":
        """Clip postures to the limits and take their wrist poses for targets."""
        clipped = np.clip(q, robot.lower, robot.upper)
        return cls(name, clipped, *wrists(robot, clipped), fps, (clipped == q).all(axis=1))


def recorded(robot: Robot, frames: int | None = None) -> list[JointPath]:
    """Every recording that has the robot's arm joints, frame by frame as recorded, at a straight waist.

    Args:
        robot: The robot.
        frames: Longest part of a recording to take; None for all of it.

    Returns:
        One path a recording, none where there are none; see `benchmarks.clips`.
    """
    paths = []
    for file in sorted(folder().glob("*.npz")):
        with np.load(file) as clip:
            names = clip["joint_names"].tolist()
            if set(robot.joint_names) <= set(names):
                q = clip["q"][:frames, [names.index(name) for name in robot.joint_names]].astype(float)
                paths.append(JointPath.of(robot, file.stem, q, float(clip["fps"])))
    return paths


def random_path(robot: Robot, frames: int, seed: int, share: float = 0.95) -> JointPath:
    """Smooth motion all over a share of the joint ranges."""
    middle, half = (robot.lower + robot.upper) / 2.0, (robot.upper - robot.lower) / 2.0
    q = middle + share * half * waves(np.random.default_rng(seed), frames, robot.nq)
    return JointPath.of(robot, f"random {seed}", q)


def clear_path(robot: Robot, distances: SelfDistances, frames: int, seed: int, share: float = 0.95) -> JointPath:
    """Smooth motion about a clear posture, made smaller until all of it keeps the margin.

    Args:
        robot: The robot.
        distances: Measures clearance.
        frames: Number of frames.
        seed: Of the random numbers.
        share: Share of the joint ranges within which it stays.

    Returns:
        The path; it fills as much of the room to the limits as is clear, `LEAST_AMPLITUDE` of it at least.
    """
    rng = np.random.default_rng(seed)
    middle, half = (robot.lower + robot.upper) / 2.0, (robot.upper - robot.lower) / 2.0
    while True:
        center = rng.uniform(middle - share * half, middle + share * half)
        motion = waves(rng, frames, robot.nq) * (share * half - np.abs(center - middle))
        amplitude = 1.0
        while amplitude >= LEAST_AMPLITUDE:
            q = center + amplitude * motion
            # Most fail somewhere, which a look at a few frames tells sooner.
            if all((distances.clearance(q[some]) >= robot.collision.margin).all() for some in (np.s_[::25], np.s_[:])):
                return JointPath.of(robot, f"clear {seed}", q)
            amplitude *= 0.8


def clear_postures(robot: Robot, distances: SelfDistances, count: int, rng: np.random.Generator) -> np.ndarray:
    """Postures uniform within the limits, kept when they keep the margin [rad], shape (count, nq)."""
    kept = np.empty((0, robot.nq))
    while len(kept) < count:
        q = rng.uniform(robot.lower, robot.upper, (2 * count, robot.nq))
        kept = np.concatenate([kept, q[distances.clearance(q) >= robot.collision.margin]])
    return kept[:count]


def waves(rng: np.random.Generator, frames: int, joints: int) -> np.ndarray:
    """Sums of sinusoids of 0.03 to 0.2 Hz with amplitudes that add up to one, at 50 Hz, shape (frames, joints)."""
    t = np.arange(frames)[:, None, None] * PERIOD
    shape = (1, WAVES, joints)
    amplitude = rng.uniform(0.3, 1.0, shape)
    frequency, phase = rng.uniform(0.03, 0.2, shape), rng.uniform(0.0, 2.0 * np.pi, shape)
    return (amplitude / amplitude.sum(axis=1, keepdims=True) * np.sin(2.0 * np.pi * frequency * t + phase)).sum(axis=1)


def follow(
    solver: Solver,
    path: JointPath,
    collision: Collision,
    smooth: bool = False,
    advance: Callable[[int], None] = lambda _: None,
) -> np.ndarray:
    """Follow a path, each frame from what the robot was told in the frame before.

    Args:
        solver: The solver.
        path: The path; its first posture is where the robot starts.
        collision: The setting of the requests.
        smooth: Whether the robot is told the answers filtered as OpenWBT filters them.
        advance: Called with the number of frames solved.

    Returns:
        What the robot was told [rad], shape (N, nq).
    """
    smoothing: Callable[[np.ndarray], np.ndarray] = WeightedMovingFilter() if smooth else np.copy
    q, told = path.q[0], np.empty_like(path.q)
    for k, (left, right) in enumerate(zip(path.left, path.right, strict=True)):
        told[k] = q = smoothing(solver.solve(left, right, q, collision=collision).q)
    advance(len(path))
    return told


def runs(flags: np.ndarray) -> Iterator[slice]:
    """Stretches of consecutive frames that are all true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return (slice(begin, end) for begin, end in edges.reshape(-1, 2).tolist())
