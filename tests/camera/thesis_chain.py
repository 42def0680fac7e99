"""The published chain, defects included, as the yardstick of `camera_client`.

Every joint is the mean of 3 x 3 depths at its pixel; without depth its last value is used for ever. A Kalman filter of
constant velocity smooths it, in millimetres, with the step of 30 Hz although frames come at half that rate. Points are
turned into the pelvis frame about mid-hips, which are moved back by 0.1 m. A wrist's orientation is that of the elbow's
bend, however small it is.

Two defects are left out, in its favour. The published axes are a reflection, made for a point cloud with y up; on the
optical frame that is used here everything would be upside down. And by the letter the hips are moved back twice.
"""

import numpy as np
from skinned_person import Array

from camera_client.frame import RgbdFrame
from camera_client.landmarks import HIPS, TRACKED, Landmarks

Z_OFFSET = 0.1
"""By how much the pelvis is taken to be behind the hips that are seen [m]."""
EVERY = 2
"""Its pose model took 68 ms: it saw every second frame of 30 Hz."""

_R_PELVIS_CAMERA = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_DT = 1.0 / 30.0


class ThesisChain:
    """Both arms by the published method."""

    def __init__(self) -> None:
        self._filters: dict[int, _Filter] = {}
        self._points: dict[int, Array] = {}
        self._joints = np.full((len(TRACKED), 3), np.nan)
        self._frames = 0

    def update(self, frame: RgbdFrame, landmarks: Landmarks) -> tuple[Array, Array]:
        """Take a frame.

        Returns:
            Shoulders, elbows and wrists in the pelvis frame, shape (2, 3, 3) [m], and the wrists' orientations, shape
            (2, 3, 3). They are those of the last frame while the model is busy.
        """
        if self._frames % EVERY == 0:
            self._look(frame, landmarks)
        self._frames += 1
        origin = self._joints[HIPS].mean(axis=0) + np.array([0.0, 0.0, Z_OFFSET])
        joints = ((self._joints[:6] - origin) @ _R_PELVIS_CAMERA.T).reshape(2, 3, 3)
        return joints, np.stack([bend_basis(arm) for arm in joints])

    def _look(self, frame: RgbdFrame, landmarks: Landmarks) -> None:
        assert frame.depth is not None
        height, width = frame.depth.shape
        k = frame.intrinsics
        for j, number in enumerate(TRACKED):
            x, y = (int(value) for value in landmarks.pixels[number])
            if 0 <= x < width and 0 <= y < height:
                patch = frame.depth[max(0, y - 1) : y + 2, max(0, x - 1) : x + 2].astype(float)
                if (patch > 0).any():
                    ray = np.array([(x - k.cx) / k.fx, (y - k.cy) / k.fy, 1.0])
                    self._points[j] = ray * patch[patch > 0].mean()
                    self._filters.setdefault(j, _Filter(self._points[j]))
            if j in self._points:
                self._joints[j] = self._filters[j].step(self._points[j]) / 1000.0


class _Filter:
    """The published filter of one joint [mm]: Q = 0.01 I, R = 0.1 I."""

    def __init__(self, point: Array) -> None:
        self._x = np.concatenate([point, np.zeros(3)])
        self._P = np.eye(6)
        self._A = np.eye(6)
        self._A[:3, 3:] = _DT * np.eye(3)

    def step(self, point: Array) -> Array:
        H = np.eye(3, 6)
        self._x = self._A @ self._x
        self._P = self._A @ self._P @ self._A.T + 1e-2 * np.eye(6)
        K = self._P @ H.T @ np.linalg.inv(H @ self._P @ H.T + 1e-1 * np.eye(3))
        self._x = self._x + K @ (point - H @ self._x)
        self._P = (np.eye(6) - K @ H) @ self._P
        return self._x[:3].copy()


def bend_basis(arm: Array) -> Array:
    """Orientation of a wrist from shoulder, elbow and wrist, shape (3, 3), as published."""
    u, f = arm[1] - arm[0], arm[2] - arm[1]
    x = f / max(np.linalg.norm(f), 1e-12)
    y = np.cross(x, u)
    y /= max(float(np.linalg.norm(y)), 1e-12)
    return np.stack([x, y, np.cross(x, y)], axis=1)
