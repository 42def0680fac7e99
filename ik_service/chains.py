"""Chains of revolute joints: an arm from the base to its wrist, and the waist that carries both arms."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

_REACH_STARTS, _REACH_SWEEPS = 4, 5
"""Starts and sweeps of the climb to the farthest posture; on the G1 every start ends within 0.1 mm of the
farthest."""

_STRAIGHT_MARGIN = 0.1
"""How far before the straight arm hyperextension begins [rad]."""


@dataclass(frozen=True)
class ArmChain:
    """One arm: revolute joints in series from the base to a wrist frame.

    Attributes:
        side: "left" or "right".
        joint_names: Joints from shoulder to wrist, n of them.
        placements: Pose of each joint at zero angle in the frame of the one before it, the first in the base frame at a
            straight waist; n arrays of shape (4, 4).
        axes: Unit rotation axis of each joint in its own frame, n arrays of shape (3,).
        T_last_wrist: Wrist frame in the last joint's frame, shape (4, 4).
        lower: Lower joint limits [rad], shape (n,).
        upper: Upper joint limits [rad], shape (n,).
        masses: Mass of the body each joint moves, with all that is fixed to it, n of them [kg].
        centers: Centre of mass of that body in its joint's frame [m], n arrays of shape (3,).
        gravity: Acceleration of gravity in the base frame [m/s^2], shape (3,).
        elbow: Index of the elbow among the joints; None where the description names none.
    """

    side: str
    joint_names: tuple[str, ...]
    placements: tuple[np.ndarray, ...]
    axes: tuple[np.ndarray, ...]
    T_last_wrist: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    masses: tuple[float, ...]
    centers: tuple[np.ndarray, ...]
    gravity: np.ndarray
    elbow: int | None = None

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def shoulder(self) -> np.ndarray:
        """Origin of the first joint in the base frame [m], shape (3,)."""
        return self.placements[0][:3, 3]

    def wrist(self, q: np.ndarray) -> np.ndarray:
        """Forward kinematics of this arm alone.

        Args:
            q: Joint positions [rad], shape (n,).

        Returns:
            `T_base_wrist` at a straight waist, shape (4, 4).
        """
        return self.wrists(q[None])[0]

    def wrists(self, q: np.ndarray) -> np.ndarray:
        """Forward kinematics of this arm alone in many postures.

        Args:
            q: Joint positions [rad], shape (N, n).

        Returns:
            `T_base_wrist` at a straight waist, shape (N, 4, 4).
        """
        T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
        for placement, axis, angle in zip(self.placements, self.axes, q.T, strict=True):
            outer = np.outer(axis, axis)
            turn = np.broadcast_to(np.eye(4), (len(q), 4, 4)).copy()
            cos, sin = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
            turn[:, :3, :3] = outer + cos * (np.eye(3) - outer) + sin * pin.skew(axis)
            T = T @ placement @ turn
        return T @ self.T_last_wrist

    @cached_property
    def upper_arm(self) -> float:
        """Distance from shoulder to elbow at q = 0 [m]; zero without an elbow."""
        T = np.eye(4)
        for placement in self.placements[: (self.elbow or 0) + 1]:
            T = T @ placement
        return float(np.linalg.norm(T[:3, 3] - self.shoulder))

    @cached_property
    def straight_elbow(self) -> tuple[float, float]:
        """Elbow angle [rad] from which on the arm counts as hyperextended, and the direction of more (1 or -1).

        An elbow that can pass the straight arm has a second branch of solutions behind it, with little room before its
        limit. The angle lies `_STRAIGHT_MARGIN` before the straight one, on the side of q = 0.
        """
        assert self.elbow is not None
        angle = self._farthest(np.zeros(len(self.lower)), self.elbow)
        side = 1.0 if angle > 0.0 else -1.0
        return angle - side * _STRAIGHT_MARGIN, side

    @cached_property
    def reach(self) -> float:
        """Largest distance from the shoulder to the wrist frame [m].

        In one joint alone the squared distance is a + b cos q + c sin q, whose largest value within the limits is known
        exactly. Setting joint after joint to its best climbs to a maximum within a few sweeps; the highest from a
        handful of fixed starts is taken.
        """
        starts = np.random.default_rng(0).uniform(self.lower, self.upper, (_REACH_STARTS, len(self.lower)))
        return max(self._stretch(q) for q in starts)

    def _stretch(self, q: np.ndarray) -> float:
        """Climb from a posture to a locally farthest one, in place; return its distance [m]."""
        for _ in range(_REACH_SWEEPS):
            for i in range(len(q)):
                q[i] = self._farthest(q, i)
        return float(np.linalg.norm(self.wrist(q)[:3, 3] - self.shoulder))

    def _farthest(self, q: np.ndarray, joint: int) -> float:
        """Angle of one joint within its limits at which the wrist is farthest from the shoulder [rad]."""
        ahead, aside, behind = (self._distance(q, joint, angle) ** 2 for angle in (0.0, np.pi / 2.0, np.pi))
        peak = np.arctan2(aside - (ahead + behind) / 2.0, (ahead - behind) / 2.0)
        turns = peak + np.array([-2.0, 0.0, 2.0]) * np.pi
        inside = turns[(self.lower[joint] < turns) & (turns < self.upper[joint])]
        candidates = np.array([*inside, self.lower[joint], self.upper[joint]])
        return float(candidates[np.argmax([self._distance(q, joint, angle) for angle in candidates])])

    def _distance(self, q: np.ndarray, joint: int, angle: float) -> float:
        """Distance from shoulder to wrist [m] with one joint set to an angle [rad]."""
        changed = q.copy()
        changed[joint] = angle
        return float(np.linalg.norm(self.wrist(changed)[:3, 3] - self.shoulder))


@dataclass(frozen=True)
class WaistChain:
    """The joints between the base and the body that carries both arms: revolute, in series, possibly none.

    Attributes:
        joint_names: Joints from the base upwards, n of them.
        placements: Pose of each joint at zero angle in the frame of the one before it, the first in the base frame; n
            arrays of shape (4, 4).
        axes: Unit rotation axis of each joint in its own frame, n arrays of shape (3,).
    """

    joint_names: tuple[str, ...]
    placements: tuple[np.ndarray, ...]
    axes: tuple[np.ndarray, ...]

    def motion(self, angles: np.ndarray) -> np.ndarray:
        """How far bending carries the shoulders.

        Args:
            angles: Waist joint positions [rad], shape (n,).

        Returns:
            Pose in the base frame of what coincides with the base frame at a straight waist, shape (4, 4).
        """
        bent, straight = np.eye(4), np.eye(4)
        for placement, axis, angle in zip(self.placements, self.axes, angles, strict=True):
            bent, straight = bent @ placement, straight @ placement
            bent[:3, :3] = bent[:3, :3] @ pin.exp3(angle * axis)
        return bent @ np.linalg.inv(straight)
