"""Targets that every solver benchmark shares; the same numbers in every run.

- tracking: smooth motion at 50 Hz inside 80 % of the joint limits; each frame starts from the previous solution.
- cold: a reachable target and an unrelated start, both within 95 % of the limits.
- unreachable: smooth motion with a nearly straight elbow, wrist positions stretched to 1.3 times their distance from
  the shoulder; each frame starts from the previous solution.
- crossing: both hands sweep across the midline at the same height and depth, so that they pass through each other and
  through the place of the other arm; reachable for each arm alone, not for a body; each frame starts from the
  previous solution.
"""

from dataclasses import dataclass

import numpy as np

from ik_service.robot import Robot

PERIOD = 1.0 / 50.0
"""Time between two frames [s]."""

OUT_OF_REACH = 1.3
"""How far unreachable targets are stretched away from the shoulder [1]."""


@dataclass(frozen=True)
class Workload:
    """A sequence of problems.

    Attributes:
        name: "tracking", "cold", "unreachable" or "crossing"; or what the maker of another one calls it.
        left: Targets of the left wrist in the base frame, shape (N, 4, 4).
        right: Targets of the right wrist in the base frame, shape (N, 4, 4).
        starts: Joint positions of the request [rad], shape (N, nq); None where frame k starts from the solution of
            frame k - 1.
        first: Joint positions of the first request [rad], shape (nq,).
    """

    name: str
    left: np.ndarray
    right: np.ndarray
    starts: np.ndarray | None
    first: np.ndarray

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.left)

    def start(self, k: int, previous: np.ndarray) -> np.ndarray:
        """Joint positions of request k [rad], given the solution of the request before it."""
        return previous if self.starts is None else self.starts[k]


def tracking(robot: Robot, frames: int = 2000, seed: int = 1) -> Workload:
    """Smooth motion well within reach."""
    lower, upper = _inside(robot, 0.8)
    q = _smooth(np.random.default_rng(seed), frames, lower, upper)
    return Workload("tracking", *_wrists(robot, q), starts=None, first=q[0])


def cold(robot: Robot, frames: int = 500, seed: int = 2) -> Workload:
    """Reachable targets, unrelated starts."""
    rng = np.random.default_rng(seed)
    lower, upper = _inside(robot, 0.95)
    q = rng.uniform(lower, upper, (frames, robot.nq))
    starts = rng.uniform(lower, upper, (frames, robot.nq))
    return Workload("cold", *_wrists(robot, q), starts=starts, first=starts[0])


def unreachable(robot: Robot, frames: int = 500, seed: int = 3) -> Workload:
    """Smooth motion beyond the reach of both arms."""
    lower, upper = _inside(robot, 0.8)
    elbows = [i for i, name in enumerate(robot.joint_names) if "elbow" in name]
    lower[elbows], upper[elbows] = 1.1, 1.9  # the G1's elbow is straight at about 1.5 rad
    q = _smooth(np.random.default_rng(seed), frames, lower, upper)
    left, right = _wrists(robot, q)
    for targets, arm in zip((left, right), robot.arms, strict=True):
        targets[:, :3, 3] = arm.shoulder + OUT_OF_REACH * (targets[:, :3, 3] - arm.shoulder)
    return Workload("unreachable", left, right, starts=None, first=q[0])


CROSSINGS_HZ = 0.2
"""Sweeps of `crossing` there and back a second [Hz]."""


def crossing(robot: Robot, frames: int = 400) -> Workload:
    """Both hands in front of the chest, sweeping through each other; the right arm mirrors the left."""
    t = np.arange(frames) * PERIOD
    sweep = np.cos(2.0 * np.pi * CROSSINGS_HZ * t)
    height = np.sin(2.0 * np.pi * 0.07 * t)
    postures = {  # of the left arm, on its own side and beyond the midline, and by how much the height changes [rad]
        "shoulder_pitch": (-0.7, -1.0, 0.1),
        "shoulder_roll": (0.2, -0.3, 0.0),
        "shoulder_yaw": (0.2, -1.0, 0.0),
        "elbow": (0.5, 0.8, -0.1),
    }
    q = np.zeros((frames, robot.nq))
    for i, name in enumerate(robot.joint_names):
        side, joint = name.removesuffix("_joint").split("_", 1)
        own, beyond, lift = postures.get(joint, (0.0, 0.0, 0.0))
        angle = (own + beyond) / 2.0 + (own - beyond) / 2.0 * sweep + lift * height
        q[:, i] = -angle if side == "right" and joint.endswith(("roll", "yaw")) else angle
    return Workload("crossing", *_wrists(robot, q), starts=None, first=q[0])


def along(robot: Robot, name: str, q: np.ndarray) -> Workload:
    """A workload whose targets are the wrist poses of a recorded path.

    Args:
        robot: The robot.
        name: The workload's name.
        q: Joint positions of the path, one row a frame [rad], shape (N, nq), within the limits.

    Returns:
        The workload; each frame starts from the previous solution.
    """
    return Workload(name, *_wrists(robot, q), starts=None, first=q[0])


def _inside(robot: Robot, share: float) -> tuple[np.ndarray, np.ndarray]:
    middle, half = (robot.lower + robot.upper) / 2.0, (robot.upper - robot.lower) / 2.0
    return middle - share * half, middle + share * half


def _smooth(rng: np.random.Generator, frames: int, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Sum of five sinusoids a joint, 0.03 to 0.2 Hz, amplitudes adding up to the half range."""
    t = np.arange(frames)[:, None, None] * PERIOD
    shape = (1, 5, len(lower))
    amplitude = rng.uniform(0.3, 1.0, shape)
    frequency, phase = rng.uniform(0.03, 0.2, shape), rng.uniform(0.0, 2.0 * np.pi, shape)
    waves = (amplitude / amplitude.sum(1, keepdims=True)) * np.sin(2.0 * np.pi * frequency * t + phase)
    return (lower + upper) / 2.0 + (upper - lower) / 2.0 * waves.sum(1)


def _wrists(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    poses = [robot.fk(row) for row in q]
    return np.array([left for left, _ in poses]), np.array([right for _, right in poses])
