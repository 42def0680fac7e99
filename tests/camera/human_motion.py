"""Motion of real people, as joints in the frame of their pelvis: SMPL skeletons from video, and optical motion capture.

The pelvis frame has z along the trunk, and y to the left by shoulders and hips. So a person who bends over has arms as
an upright one, as a robot has that does not bend.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from skinned_person import Array

_SMPL = {"shoulders": (16, 17), "elbows": (18, 19), "wrists": (20, 21), "hips": (1, 2)}
_CLIMB = {"shoulders": (6, 25), "elbows": (7, 26), "wrists": (8, 27), "hips": (43, 47)}
_FPS = 30.0


@dataclass(frozen=True)
class HumanMotion:
    """A clip.

    Attributes:
        name: Of the clip.
        times: Of its frames [s].
        arms: Shoulder, elbow and wrist, left and right, pelvis frame, shape (n, 2, 3, 3) [m].
    """

    name: str
    times: Array
    arms: Array

    def at(self, rate: float, most: float = np.inf) -> Array:
        """Unit directions of upper arms and forearms at another rate [Hz], for `most` seconds, shape (n, 2, 2, 3)."""
        t = np.arange(0.0, min(self.times[-1], most), 1.0 / rate)
        flat = self.arms.reshape(len(self.times), -1)
        arms = np.stack([np.interp(t, self.times, column) for column in flat.T], axis=1).reshape(-1, 2, 3, 3)
        limbs = np.diff(arms, axis=2)
        return limbs / np.linalg.norm(limbs, axis=-1, keepdims=True)


def human_motions(folder: Path) -> list[HumanMotion]:
    """All clips of the shared data, the folder `human`."""
    clips = np.load(folder / "smpl" / "joints_30fps.npz")
    out = [_motion(name, clips[name], _SMPL) for name in sorted(clips.files)]
    climb = folder / "mocap" / "climb_1.npy"
    return [*out, _motion("climb_1", np.load(climb), _CLIMB)]


def _motion(name: str, joints: Array, where: dict[str, tuple[int, int]]) -> HumanMotion:
    joints = joints.astype(float)
    shoulders, elbows, wrists, hips = (
        joints[:, list(where[part])] for part in ("shoulders", "elbows", "wrists", "hips")
    )
    across = shoulders[:, 0] - shoulders[:, 1] + hips[:, 0] - hips[:, 1]
    up = shoulders.mean(axis=1) - hips.mean(axis=1)
    z = _unit(up)
    y = _unit(across - z * (across * z).sum(axis=-1, keepdims=True))
    R = np.stack([np.cross(y, z), y, z], axis=1)
    arms = np.stack([shoulders, elbows, wrists], axis=2) - hips.mean(axis=1)[:, None, None]
    return HumanMotion(name, np.arange(len(joints)) / _FPS, np.einsum("nij,nakj->naki", R, arms))


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)
