"""Recorded motion of the whole robot as wrist targets.

A motion file is a NumPy archive (.npz) with `q` of shape (T, n) [rad], `fps` [1/s] and `joint_names` (n names, in any
order, with at least the arm joints among them). The targets are where the wrists of the recorded arms are in the pelvis
frame with the waist straight, since that is what the service solves for; joints beyond their limits are cut to them.
"""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ik_proto import Array
from sim_client.arms import ArmKinematics
from sim_client.poses import interpolate

_FIELDS = ("q", "fps", "joint_names")


class MotionError(ValueError):
    """A motion file that cannot be played: one line that says why.

    Attributes:
        source: The file.
    """

    def __init__(self, source: Path, message: str) -> None:
        """Put the file in front of the message."""
        super().__init__(f"{source}: {message}")
        self.source = source


class RecordedMotion:
    """Wrist poses of a recording, at any time between its frames.

    Attributes:
        fps: Frames per second.
        q: Arm joints of the recording within their limits, wire order, shape (T, n) [rad].
        clipped: Fraction of the joint values that were beyond a limit.
    """

    def __init__(self, source: str | Path, arms: ArmKinematics) -> None:
        """Read a file and compute its wrist poses.

        Args:
            source: The .npz file.
            arms: The arms that play it.

        Raises:
            MotionError: The file is missing, not of the right form, or has no such joints.
        """
        path = Path(source)
        fields = _read(path)
        self.fps = _frame_rate(path, fields["fps"])
        recorded = _arm_joints(path, fields, arms.joint_names)
        self.q = np.clip(recorded, arms.lower, arms.upper)
        self.clipped = float(np.mean(self.q != recorded))
        self._frames = [arms.wrists(q) for q in self.q]

    @property
    def length(self) -> float:
        """Time from the first frame to the last [s]."""
        return (len(self._frames) - 1) / self.fps

    def poses(self, time: float) -> tuple[Array, Array]:
        """Wrist poses `T_pelvis_wrist`, left and right, shape (4, 4) each [m]; the last frame's after the end."""
        place = min(time * self.fps, len(self._frames) - 1.0)
        before = int(place)
        after = min(before + 1, len(self._frames) - 1)
        (left, right), (next_left, next_right) = self._frames[before], self._frames[after]
        fraction = place - before
        return interpolate(left, next_left, fraction), interpolate(right, next_right, fraction)


def _read(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise MotionError(path, "no such file")
    if not zipfile.is_zipfile(path):
        raise MotionError(path, "is not a NumPy archive (.npz)")
    try:
        with np.load(path, allow_pickle=False) as archive:
            missing = [name for name in _FIELDS if name not in archive.files]
            if missing:
                raise MotionError(path, f"has no {missing[0]!r}; a motion file has {', '.join(_FIELDS)}")
            return {name: archive[name] for name in _FIELDS}
    except MotionError:
        raise
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):
        raise MotionError(path, "is damaged or holds Python objects; save plain arrays with numpy.savez") from None


def _frame_rate(path: Path, fps: Array) -> float:
    if fps.size != 1 or fps.dtype.kind not in "fiu" or not np.isfinite(fps).all() or float(fps.item()) <= 0.0:
        raise MotionError(path, "fps must be one positive number")
    return float(fps.item())


def _arm_joints(path: Path, fields: dict[str, Any], wanted: tuple[str, ...]) -> Array:
    q, names = fields["q"], [str(name) for name in np.atleast_1d(fields["joint_names"])]
    if q.dtype.kind not in "fiu" or q.ndim != 2 or q.shape[0] < 1 or q.shape[1] != len(names):
        raise MotionError(path, f"q has shape {q.shape}; it must be (frames, {len(names)}), one column a joint name")
    if not np.isfinite(q).all():
        raise MotionError(path, f"q is not finite in frame {int(np.argwhere(~np.isfinite(q))[0, 0])}")
    missing = [name for name in wanted if name not in names]
    if missing:
        raise MotionError(path, f"has no joint {missing[0]}")
    return q[:, [names.index(name) for name in wanted]].astype(np.float64)
