"""Two seconds of a T pose, in which an operator is fitted.

The arms are across the viewing direction there, where pixels tell lengths best. Every frame is checked, and says to the
operator what is missing; joints are the medians over the good ones.
"""

import math
from dataclasses import replace

import numpy as np

from camera_client.calibration import Calibration, CalibrationError
from camera_client.depth_patch import patch_depths
from camera_client.frame import RgbdFrame
from camera_client.landmarks import ARMS, HIPS, SHOULDERS, TRACKED, Landmarks
from camera_client.surface import LEAN, OFFSETS, shoulder_shift
from camera_client.torso import facing_yaw, level_rotation
from camera_client.trunk_plane import trunk_turn
from camera_client.vectors import length, unit
from ik_proto import Array

DURATION = 2.0
"""How long a T pose is held [s]."""
LEAST_FRAMES = 20
"""Good frames that a calibration needs."""

_LEVEL = math.radians(25.0)
"""How far from a T the arms may be."""
_STEADY = 0.04
"""How far a joint may move about its median, rms [m]."""
_UP_CAMERA = np.array([0.0, -1.0, 0.0])
"""Up before the tilt is known; good enough for a shift of a few pixels."""
_BACK = np.array([0.0, 0.0, 1.0])
"""The operator's backward, who faces the camera."""


class TPose:
    """Collects the frames of a T pose.

    Attributes:
        good: How many frames counted.
        fault: Why the last one did not, as a sentence to the operator; empty where it did.
    """

    def __init__(self) -> None:
        """Start without frames."""
        self.fault = ""
        self._joints: list[Array] = []
        self._fronts: list[float] = []

    @property
    def good(self) -> int:
        """How many frames counted."""
        return len(self._joints)

    def add(self, frame: RgbdFrame, landmarks: Landmarks | None) -> bool:
        """Take a frame and say whether it counts."""
        joints, self.fault = _joints_of(frame, landmarks)
        if joints is not None:
            assert landmarks is not None
            assert frame.depth is not None
            corners = landmarks.pixels[TRACKED][[*SHOULDERS, *HIPS]]
            self._joints.append(joints)
            self._fronts.append(trunk_turn(frame.depth, corners, frame.intrinsics))
        return joints is not None

    def finish(self, up_camera: Array | None = None) -> Calibration:
        """Fit the operator.

        Args:
            up_camera: Up, optical frame, shape (3,), by a level or an accelerometer; None tells it from the operator's
                trunk.

        Raises:
            CalibrationError: Too few frames, an operator who moved, or lengths that nobody has.
        """
        if len(self._joints) < LEAST_FRAMES:
            why = f": {self.fault}" if self.fault else ""
            raise CalibrationError(f"only {len(self._joints)} of {LEAST_FRAMES} frames showed a T pose{why}; try again")
        stack = np.stack(self._joints)
        joints = np.median(stack, axis=0)
        # Along the optical axis a measurement is noisier than a person who stands still.
        moved = np.sqrt(((stack - joints)[..., :2] ** 2).sum(axis=-1).mean(axis=0)).max()
        if moved > _STEADY:
            raise CalibrationError(f"you moved by {100 * moved:.0f} cm: hold the T pose still for {DURATION:.0f} s")
        arms = joints[ARMS].reshape(2, 3, 3)
        lengths = length(arms[:, 1:] - arms[:, :-1])
        shoulders, hips = joints[SHOULDERS].mean(axis=0), joints[HIPS].mean(axis=0)
        trunk = shoulders - hips
        up = unit(trunk + LEAN * length(trunk) * _BACK if up_camera is None else up_camera)
        R = level_rotation(up)
        sides = joints[[SHOULDERS[0], HIPS[0]]] - joints[[SHOULDERS[1], HIPS[1]]]
        yaw = facing_yaw(R @ sides.sum(axis=0))
        c, s = math.cos(yaw), math.sin(yaw)
        below = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ R @ (hips - shoulders)
        fronts = np.array(self._fronts)
        fronts = fronts[np.isfinite(fronts)]
        fitted = Calibration(lengths, below, up, float(fronts.mean()) if len(fronts) else 0.0)
        # Arms are alike to a percent; what differs within the bound is the measurement.
        return replace(fitted, lengths=np.tile(lengths.mean(axis=0), (2, 1)))


def _joints_of(frame: RgbdFrame, landmarks: Landmarks | None) -> tuple[Array | None, str]:
    """Joints of a frame that shows a T pose, optical frame, shape (8, 3) [m]; or why it does not."""
    if frame.depth is None:
        return None, "a camera without depth cannot measure you: calibrate with a depth camera"
    if landmarks is None or not landmarks.credible(*frame.size):
        return None, "nobody faces the camera"
    if not landmarks.seen(*frame.size).all():
        return None, "step back until both hands and the hips are in the picture"
    pixels = landmarks.pixels[TRACKED]
    patches = patch_depths(frame.depth, pixels, np.full(8, np.nan))
    # A thin arm before a far wall may be the smaller cluster; the torso says where the body is.
    torso = np.nanmedian(patches.depth[[*SHOULDERS, *HIPS]]) if np.isfinite(patches.depth).any() else math.nan
    if not math.isfinite(torso):
        return None, "the camera measures no depth on the body: step closer, or add light"
    patches = patch_depths(frame.depth, pixels, np.full(8, torso))
    if not (np.abs(patches.depth - torso) < 0.6).all():
        return None, "the camera measures no depth on the arms: step closer, or add light"
    pixels[SHOULDERS] += shoulder_shift(_UP_CAMERA, torso, frame.intrinsics)
    joints = frame.intrinsics.rays(pixels) * (patches.depth + OFFSETS)[:, None]
    up = unit(joints[SHOULDERS].mean(axis=0) - joints[HIPS].mean(axis=0))
    arms = joints[ARMS].reshape(2, 3, 3)
    limbs = unit(arms[:, 1:, :2] - arms[:, :-1, :2])
    across = np.array([[-up[1], up[0]], [up[1], -up[0]]])
    if ((limbs * across[:, None, :]).sum(axis=-1) < math.cos(_LEVEL)).any():
        return None, "stretch both arms out to the sides, level with the shoulders"
    return joints, ""
