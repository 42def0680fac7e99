"""A skinned person whose joints are known exactly, posed by the directions of upper arms and forearms.

Axes are those of the robot's pelvis (x forward, y left, z up), the origin is the pelvis of the mesh, lengths are in
metres. The mesh and its 19 bones are `camera/human.npz` of the shared data, which has x left and y back. Another body
is the same mesh stretched along the three axes, so that limbs, shoulders and surface change together.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

JOINTS = (
    "left_shoulder",
    "left_elbow",
    "left_wrist",
    "right_shoulder",
    "right_elbow",
    "right_wrist",
    "left_hip",
    "right_hip",
)
"""The order of ground truth: what `camera_client` tracks."""

_BONES = ("uarm.L", "farm.L", "hand.L", "uarm.R", "farm.R", "hand.R", "thigh.L", "thigh.R")


def rotation_about(axis: Array, angle: float) -> Array:
    """Rotation by an angle [rad] about a unit axis (Rodrigues), shape (3, 3)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def smallest_rotation(a: Array, b: Array) -> Array:
    """The smallest rotation that takes unit vector a to unit vector b, shape (3, 3)."""
    c = np.cross(a, b)
    s = float(np.linalg.norm(c))
    if s < 1e-9:
        return np.eye(3)
    return rotation_about(c / s, float(np.arctan2(s, a @ b)))


class Person:
    """Mesh, bones and weights, and where the bones are in a pose.

    Attributes:
        names: Names of the bones.
        heads: Where the bones begin at rest, shape (n, 3).
        vertices: Mesh at rest, shape (v, 3).
        uv: Texture coordinates, shape (v, 2).
        faces: Triangles, shape (f, 3).
        weights: Of the bones in every vertex, shape (v, n).
        height: Of the pelvis above the floor.
    """

    def __init__(self, file: Path, stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> None:
        data = np.load(file)
        self.names = [str(name) for name in data["names"]]
        self.parents = [int(parent) for parent in data["par"]]
        self.heads = _robot_axes(data["heads"], stretch)
        self.vertices = _robot_axes(data["v"], stretch)
        self.uv = data["uv"].astype(np.float32)
        self.faces = data["f"].astype(np.int32)
        self.weights = data["w"].astype(np.float32)
        self.height = -float(self.vertices[:, 2].min())
        self._index = {name: i for i, name in enumerate(self.names)}

    def pose(self, u: Array, f: Array, yaw: float = 0.0, shift: Array | None = None) -> tuple[Array, Array]:
        """Place the bones.

        Args:
            u: Directions of the left and the right upper arm in the pelvis frame, shape (2, 3).
            f: Directions of the forearms, shape (2, 3).
            yaw: How far the body is turned to its left [rad].
            shift: Where the pelvis is; at its height above the floor where absent.

        Returns:
            Rotations from rest, shape (n, 3, 3), and positions, shape (n, 3).
        """
        turn = rotation_about(np.array([0.0, 0.0, 1.0]), yaw)
        wanted = {"pelvis": turn}
        for side, u_side, f_side in zip("LR", u, f, strict=True):
            wanted |= {bone: turn @ R for bone, R in self._arm(side, _unit(u_side), _unit(f_side)).items()}
        R = np.empty((len(self.names), 3, 3))
        p = np.empty((len(self.names), 3))
        root = np.array([0.0, 0.0, self.height]) if shift is None else shift
        for i, (name, parent) in enumerate(zip(self.names, self.parents, strict=True)):
            R[i] = wanted.get(name, np.eye(3) if parent < 0 else R[parent])
            p[i] = root if parent < 0 else p[parent] + R[parent] @ (self.heads[i] - self.heads[parent])
        return R, p

    def joints(self, p: Array) -> Array:
        """Joint centres in the order of `JOINTS`, shape (8, 3), of bone positions."""
        return p[[self._index[bone] for bone in _BONES]]

    def _arm(self, side: str, u: Array, f: Array) -> dict[str, Array]:
        """World rotations of an arm's bones so that the limbs point along u and f."""
        shoulder, elbow, wrist = (self.heads[self._index[f"{bone}.{side}"]] for bone in ("uarm", "farm", "hand"))
        u_rest, f_rest = _unit(elbow - shoulder), _unit(wrist - elbow)
        axis_rest = _unit(np.cross(u_rest, f_rest))
        axis = np.cross(u, f)
        # A straight arm has no elbow axis; it takes the one that the upper arm brings along.
        axis = smallest_rotation(u_rest, u) @ axis_rest if np.linalg.norm(axis) < 1e-3 else _unit(axis)
        upper = _frame(u, axis) @ _frame(u_rest, axis_rest).T
        fore = _frame(f, axis) @ _frame(f_rest, axis_rest).T
        return {f"uarm.{side}": upper, f"farm.{side}": fore, f"hand.{side}": fore}


def _robot_axes(points: Array, stretch: tuple[float, float, float]) -> Array:
    return np.stack([-points[:, 1], points[:, 0], points[:, 2]], axis=1).astype(float) * stretch


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v)


def _frame(direction: Array, axis: Array) -> Array:
    y = _unit(axis - direction * (axis @ direction))
    return np.stack([direction, y, np.cross(direction, y)], axis=1)
