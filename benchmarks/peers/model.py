"""The robot as the peers read it: a folder with two forms of one model and what the files do not say.

`describe` writes the folder; this module reads it and needs nothing but NumPy, because it runs in every peer's
environment.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

WRISTS = ("left_wrist_target", "right_wrist_target")
"""Names of the frames that the targets are for: a link in the URDF, a site in the MJCF."""

PERIOD = 0.02
"""Time between two frames of a path [s]; what a peer with velocity limits integrates over."""


@dataclass(frozen=True)
class Model:
    """A folder written by `describe.write`.

    Attributes:
        base: The link that wrist poses are given in.
        joint_names: Left arm, then right arm.
        lower: Lower joint limits [rad], shape (nq,).
        upper: Upper joint limits [rad], shape (nq,).
        velocity: Joint velocity limits [rad/s], shape (nq,).
        urdf: Both arms.
        mjcf: Both arms.
        arm_urdfs: The left arm alone and the right arm alone.
    """

    base: str
    joint_names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    urdf: Path
    mjcf: Path
    arm_urdfs: tuple[Path, Path]

    @classmethod
    def read(cls, folder: Path) -> "Model":
        """Read a folder."""
        facts = json.loads((folder / "model.json").read_text(encoding="utf-8"))
        lower, upper, velocity = (np.array(facts[key]) for key in ("lower", "upper", "velocity"))
        return cls(
            base=facts["base"],
            joint_names=tuple(facts["joint_names"]),
            lower=lower,
            upper=upper,
            velocity=velocity,
            urdf=folder / "arms.urdf",
            mjcf=folder / "arms.xml",
            arm_urdfs=(folder / "left.urdf", folder / "right.urdf"),
        )

    @property
    def parts(self) -> tuple[slice, slice]:
        """Places of the left arm and of the right arm in q."""
        split = len(self.joint_names) // 2
        return slice(split), slice(split, None)

    def inside(self, q: np.ndarray) -> np.ndarray:
        """Joint positions clipped to the limits [rad]."""
        return np.clip(q, self.lower, self.upper)


class Peer(Protocol):
    """What a solver module's `build(model, settings)` returns."""

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Solve both arms.

        Args:
            left: Target of the left wrist in the base frame, shape (4, 4).
            right: Target of the right wrist, likewise.
            q: Joint positions to start from [rad], shape (nq,).

        Returns:
            Joint positions [rad], shape (nq,).
        """
        ...

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses of both wrists in the base frame by the peer's own kinematics, each of shape (4, 4)."""
        ...


STOP_POSITION = 0.95e-3
"""Position error at which an iterating peer stops [m]: just within the success test's 1 mm."""

STOP_ROTATION = np.deg2rad(0.99)
"""Rotation error at which an iterating peer stops [rad]."""


def close(pose: np.ndarray, target: np.ndarray) -> bool:
    """Whether a wrist is near enough to its target to stop iterating."""
    offset = pose[:3, 3] - target[:3, 3]
    cosine = (np.sum(pose[:3, :3] * target[:3, :3]) - 1.0) / 2.0
    return offset @ offset < STOP_POSITION**2 and cosine > np.cos(STOP_ROTATION)


def quaternion(R: np.ndarray) -> np.ndarray:
    """Unit quaternion wxyz of a rotation matrix, by its largest component."""
    squares = np.array([np.trace(R), R[0, 0], R[1, 1], R[2, 2]])
    largest = int(np.argmax(squares))
    if largest == 0:
        q = np.array([1.0 + squares[0], R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q = np.empty(4)
        q[0] = R[k, j] - R[j, k]
        q[1 + i] = 1.0 + R[i, i] - R[j, j] - R[k, k]
        q[1 + j] = R[j, i] + R[i, j]
        q[1 + k] = R[k, i] + R[i, k]
    return q / np.linalg.norm(q)
