"""Recorded motion of the robot's arms as a workload, where the recordings are at hand.

They are not part of the project. They are looked for in `$IK_DATA/motions`, then in `../shared/data/motions` beside the
repository: `.npz` files with `q` (frames, joints) [rad], `joint_names` and `fps`.
"""

import os
from pathlib import Path

import numpy as np

from benchmarks.workloads import PERIOD, Workload, along
from ik_service.robot import Robot


def folder() -> Path:
    """Where clips are looked for."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    return Path(os.environ.get("IK_DATA", default)) / "motions"


def clips(robot: Robot, frames: int | None = None) -> list[Workload]:
    """Every clip that has the robot's arm joints, at 50 Hz and clipped to the joint limits; the waist is straight.

    Args:
        robot: The robot.
        frames: Longest part of a clip to take; None for all of it.

    Returns:
        One workload a clip, named after its file; none where there are no clips.
    """
    found = []
    for path in sorted(folder().glob("*.npz")):
        with np.load(path) as clip:
            names = clip["joint_names"].tolist()
            if set(robot.joint_names) <= set(names):
                q = clip["q"][:, [names.index(name) for name in robot.joint_names]].astype(float)
                q = _resample(q, float(clip["fps"]))[:frames]
                found.append(along(robot, path.stem, np.clip(q, robot.lower, robot.upper)))
    return found


def _resample(q: np.ndarray, fps: float) -> np.ndarray:
    """Joint positions at the workloads' rate, by linear interpolation."""
    recorded = np.arange(len(q)) / fps
    wanted = np.arange(0.0, recorded[-1], PERIOD)
    return np.column_stack([np.interp(wanted, recorded, column) for column in q.T])
