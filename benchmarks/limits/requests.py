"""Requests that try to make the robot touch itself.

Random ones have targets and starts uniform over the joint ranges, with the waist straight or bent; half of the starts
are clear, the others as they come, most of them in penetration. Adversarial ones send the hands where the body is, at
once (a jump) or along a path.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from benchmarks.limits.geometry import SelfDistances, wrists
from benchmarks.limits.paths import clear_postures
from benchmarks.workloads import PERIOD
from ik_service.collision import Capsule, Carrier
from ik_service.robot import Robot

PATH_FRAMES = 40
"""Frames of an adversarial path: there, at up to `HAND_SPEED`, and on."""

HAND_SPEED = 1.5
"""Of a hand on an adversarial path [m/s]."""

WAIST_RANGE = np.array([1.0, 0.5, 0.5])
"""How far the waist is bent either way: yaw, roll, pitch [rad]."""


@dataclass(frozen=True)
class Requests:
    """Requests of one family, to be solved at once.

    Attributes:
        family: What they have in common.
        left: Targets of the left arm, shape (N, 4, 4).
        right: Targets of the right arm, shape (N, 4, 4).
        q: Joint positions to start from [rad], shape (N, nq).
        waist: Waist joint positions [rad], shape (N, n_waist); None for a straight waist.
    """

    family: str
    left: np.ndarray
    right: np.ndarray
    q: np.ndarray
    waist: np.ndarray | None = None

    def __len__(self) -> int:
        """Number of requests."""
        return len(self.q)


class Adversary:
    """Makes requests from a robot's shape."""

    def __init__(self, robot: Robot, distances: SelfDistances, rng: np.random.Generator, clear: int) -> None:
        """Draw the clear postures that requests start from.

        Args:
            robot: The robot.
            distances: Measures clearance.
            rng: The source of random numbers.
            clear: How many clear postures.
        """
        self._robot, self._rng = robot, rng
        self._clear = clear_postures(robot, distances, clear, rng)
        self._places: Mapping[str, Callable[[int], tuple[np.ndarray, np.ndarray]]] = {
            "arms crossing": self._crossing,
            "hands into torso": lambda count: self._into("torso", count),
            "hands to head": lambda count: self._into("head", count),
            "hands together": self._together,
        }

    @property
    def families(self) -> tuple[str, ...]:
        """Names of the adversarial families."""
        return tuple(self._places)

    def random(self, count: int, bent: bool = False) -> Requests:
        """Requests all over the joint ranges."""
        robot, rng = self._robot, self._rng
        q = rng.uniform(robot.lower, robot.upper, (count, robot.nq))
        clear = np.arange(count) % 2 == 0
        q[clear] = rng.choice(self._clear, int(clear.sum()))
        waist, T_base_mount = None, None
        if bent:
            waist = rng.uniform(-1.0, 1.0, (count, len(WAIST_RANGE))) * WAIST_RANGE
            T_base_mount = np.array([robot.waist.motion(row) for row in waist])
        targets = wrists(robot, rng.uniform(robot.lower, robot.upper, q.shape), T_base_mount)
        return Requests("random, waist bent" if bent else "random", *targets, q, waist)

    def jumps(self, family: str, count: int) -> Requests:
        """Requests from clear postures straight to where the body is."""
        q = self._rng.choice(self._clear, count)
        return Requests(f"{family}, jump", *self._targets(family, count), q)

    def path(self, family: str, count: int) -> Iterator[Requests]:
        """Many paths side by side, frame after frame; the q of all but the first are for the caller to fill in."""
        q = self._rng.choice(self._clear, count)
        goals = self._targets(family, count)
        stretches = [_straight(T, goal) for T, goal in zip(wrists(self._robot, q), goals, strict=True)]
        for frame in range(1, PATH_FRAMES + 1):
            left, right = (stretch(frame * PERIOD * HAND_SPEED) for stretch in stretches)
            yield Requests(f"{family}, path", left, right, q)

    def _targets(self, family: str, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Wrist poses: places of the family, orientations that the wrists can have somewhere."""
        robot, rng = self._robot, self._rng
        targets = wrists(robot, rng.uniform(robot.lower, robot.upper, (count, robot.nq)))
        for T, place in zip(targets, self._places[family](count), strict=True):
            T[:, :3, 3] = place
        return targets

    def _crossing(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Each hand in front of the other side."""
        left = self._rng.uniform((0.10, -0.35, -0.10), (0.45, -0.05, 0.40), (count, 3))
        right = self._rng.uniform((0.10, -0.35, -0.10), (0.45, -0.05, 0.40), (count, 3))
        return left, right * (1.0, -1.0, 1.0)

    def _together(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Both hands within a hand's breadth of one place in front."""
        place = self._rng.uniform((0.15, -0.15, -0.10), (0.45, 0.15, 0.40), (count, 3))
        apart = self._rng.uniform(-0.05, 0.05, (2, count, 3))
        return place + apart[0], place + apart[1]

    def _into(self, name: str, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Each hand inside a capsule of that part of the body."""
        capsules = [
            capsule
            for capsule in self._robot.collision.capsules
            if capsule.carrier is Carrier.TORSO and capsule.name.startswith(name)
        ]
        return self._inside(capsules, count), self._inside(capsules, count)

    def _inside(self, capsules: list[Capsule], count: int) -> np.ndarray:
        chosen = [capsules[k] for k in self._rng.integers(len(capsules), size=count)]
        share = self._rng.uniform(size=(count, 1))
        axis = np.array([capsule.start for capsule in chosen]) * (1.0 - share)
        axis += np.array([capsule.end for capsule in chosen]) * share
        reach = np.array([capsule.radius for capsule in chosen])[:, None] / np.sqrt(3.0)
        return axis + reach * self._rng.uniform(-1.0, 1.0, (count, 3))


def _straight(begin: np.ndarray, end: np.ndarray) -> Callable[[float], np.ndarray]:
    """Poses along straight lines, turning about one axis: by the distance travelled [m], shape (N, 4, 4) each."""
    along = end[:, :3, 3] - begin[:, :3, 3]
    length = np.linalg.norm(along, axis=1)
    relative = begin[:, :3, :3].transpose(0, 2, 1) @ end[:, :3, :3]
    turns = np.array([pin.log3(R) for R in relative])

    def pose(travelled: float) -> np.ndarray:
        share = np.minimum(travelled / length, 1.0)[:, None]
        T = begin.copy()
        T[:, :3, 3] += share * along
        T[:, :3, :3] @= np.array([pin.exp3(w) for w in share * turns])
        return T

    return pose
