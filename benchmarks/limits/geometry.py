"""Distances of the robot from itself, worked out apart from the solver: NumPy over many postures at once.

It shares with the solver what the robot is (placements, axes, capsules, pairs) and none of its code. Two segments are
nearest either at an end of one of them or where their lines cross; all five candidates are looked at, where the solver
clamps its way to one.

Everything is in the mount frame: the base frame at a straight waist, carried along by the waist.
"""

from collections.abc import Iterator

import numpy as np

from ik_service.chains import ArmChain
from ik_service.collision import Carrier
from ik_service.robot import Robot

CHUNK = 1000
"""Postures measured at once; more no longer fit the cache."""


class SelfDistances:
    """Distances of all checked pairs of capsules."""

    def __init__(self, robot: Robot) -> None:
        """Take a robot's shape."""
        self._robot, model = robot, robot.collision
        self._ends = np.array([(capsule.start, capsule.end) for capsule in model.capsules])
        self._first, self._second = np.array(model.pairs).T
        radii = np.array([capsule.radius for capsule in model.capsules])
        self._radii = radii[self._first] + radii[self._second]

    def pairs(self, q: np.ndarray, T_base_mount: np.ndarray | None = None) -> np.ndarray:
        """Clearance of every checked pair.

        Args:
            q: Joint positions [rad], shape (N, nq).
            T_base_mount: Motion of the waist, shape (N, 4, 4); None for a straight waist.

        Returns:
            Distances of the capsules [m], negative in penetration, shape (N, pairs).
        """
        result = np.empty((len(q), len(self._radii)))
        for rows in chunks(len(q)):
            ends = self.ends(q[rows], None if T_base_mount is None else T_base_mount[rows])
            a, b = ends[:, self._first], ends[:, self._second]
            result[rows] = segment_distances(a[:, :, 0], a[:, :, 1], b[:, :, 0], b[:, :, 1]) - self._radii
        return result

    def clearance(self, q: np.ndarray, T_base_mount: np.ndarray | None = None) -> np.ndarray:
        """Smallest distance of any checked pair [m], shape (N,); arguments as for `pairs`."""
        return self.pairs(q, T_base_mount).min(axis=1)

    def ends(self, q: np.ndarray, T_base_mount: np.ndarray | None = None) -> np.ndarray:
        """Ends of all capsules in the mount frame [m], shape (N, capsules, 2, 3); arguments as for `pairs`."""
        left, right = self._robot.arms
        bodies = {Carrier.LEFT: body_poses(left, q[:, : left.n]), Carrier.RIGHT: body_poses(right, q[:, left.n :])}
        ends = np.broadcast_to(self._ends, (len(q), *self._ends.shape)).copy()
        for place, capsule in enumerate(self._robot.collision.capsules):
            if capsule.carrier in bodies:
                T = bodies[capsule.carrier][:, capsule.joint]
            elif capsule.carrier is Carrier.BASE and T_base_mount is not None:
                T = np.linalg.inv(T_base_mount)
            else:
                continue
            ends[:, place] = self._ends[place] @ T[:, :3, :3].transpose(0, 2, 1) + T[:, None, :3, 3]
        return ends


def body_poses(arm: ArmChain, q: np.ndarray) -> np.ndarray:
    """Pose of every body of an arm in the mount frame.

    Args:
        arm: The arm.
        q: Its joint positions [rad], shape (N, n).

    Returns:
        Shape (N, n, 4, 4).
    """
    T, poses = np.broadcast_to(np.eye(4), (len(q), 4, 4)), []
    for placement, axis, angle in zip(arm.placements, arm.axes, q.T, strict=True):
        T = T @ placement @ turn(axis, angle)
        poses.append(T)
    return np.stack(poses, axis=1)


def turn(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotations about one unit axis by many angles [rad], by Rodrigues' formula, shape (N, 4, 4)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    T = np.tile(np.eye(4), (len(angle), 1, 1))
    T[:, :3, :3] += np.sin(angle)[:, None, None] * K + (1.0 - np.cos(angle))[:, None, None] * (K @ K)
    return T


def segment_distances(a0: np.ndarray, a1: np.ndarray, b0: np.ndarray, b1: np.ndarray) -> np.ndarray:
    """Distances of segments a0 a1 from segments b0 b1 [m], all of shape (..., 3)."""
    a, b, between = a1 - a0, b1 - b0, a0 - b0
    aa, bb, ab = _dot(a, a), _dot(b, b), _dot(a, b)
    a_between, b_between = _dot(a, between), _dot(b, between)
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = aa * bb - ab * ab
        s = np.nan_to_num((ab * b_between - bb * a_between) / determinant).clip(0.0, 1.0)
        t = np.nan_to_num((aa * b_between - ab * a_between) / determinant).clip(0.0, 1.0)
    crossing = _norm(between + s[..., None] * a - t[..., None] * b)
    ends = [_to_segment(a0, b0, b, bb), _to_segment(a1, b0, b, bb)]
    ends += [_to_segment(b0, a0, a, aa), _to_segment(b1, a0, a, aa)]
    return np.minimum.reduce([crossing, *ends])


def chunks(count: int) -> Iterator[slice]:
    """Slices that cover `count` rows, `CHUNK` at a time."""
    return (slice(begin, min(begin + CHUNK, count)) for begin in range(0, count, CHUNK))


def _to_segment(point: np.ndarray, start: np.ndarray, along: np.ndarray, square: np.ndarray) -> np.ndarray:
    apart = point - start
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(_dot(apart, along) / square).clip(0.0, 1.0)
    return _norm(apart - share[..., None] * along)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def _norm(a: np.ndarray) -> np.ndarray:
    return np.sqrt(_dot(a, a))


def wrists(robot: Robot, q: np.ndarray, T_base_mount: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Forward kinematics of many postures.

    Args:
        robot: The robot.
        q: Joint positions [rad], shape (N, nq).
        T_base_mount: Motion of the waist, shape (N, 4, 4); None for a straight waist.

    Returns:
        `T_base_wrist` of the left and of the right arm, each of shape (N, 4, 4).
    """
    left, right = (
        body_poses(arm, part)[:, -1] @ arm.T_last_wrist
        for arm, part in zip(robot.arms, np.split(q, [robot.arms[0].n], axis=1), strict=True)
    )
    return (left, right) if T_base_mount is None else (T_base_mount @ left, T_base_mount @ right)


def wrist_errors(robot: Robot, q: np.ndarray, left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far the worse wrist of each posture is from its target, at a straight waist.

    Args:
        robot: The robot.
        q: Joint positions [rad], shape (N, nq).
        left: Targets of the left arm, shape (N, 4, 4).
        right: Targets of the right arm, shape (N, 4, 4).

    Returns:
        Distances [m] and angles [rad], each of shape (N,).
    """
    apart = [wrist - target for wrist, target in zip(wrists(robot, q), (left, right), strict=True)]
    distances = [_norm(T[:, :3, 3]) for T in apart]
    # Of two rotations an angle w apart, the difference has the Frobenius norm 2 sqrt(2) sin(w / 2).
    chords = [np.linalg.norm(T[:, :3, :3], axis=(1, 2)) / np.sqrt(8.0) for T in apart]
    return np.maximum(*distances), 2.0 * np.arcsin(np.minimum(np.maximum(*chords), 1.0))
