"""Landmarks as a pose model would give them, made from true joints.

The numbers are those of MediaPipe's *full* model on the three rendered people of `subjects.TUNING`, in the full dance
and in drawn ones, 2.9 to 3.1 m away at 640 x 360, with some more jitter (measured are 0.25 pixels from frame to frame
at arms, 0.07 at the trunk). Most of an error is the same from frame to frame: a part that belongs to the joint (what
the model calls a shoulder is above the joint and towards the neck; landmarks of elbow and wrist stay on the arm), with
a random part that differs from person to person, and a part that depends on the posture, here a smooth random function
of it, which is two to three times as large at shoulders and elbows where the arm points at the camera. Both are
mirrored from left to right, as a model that was trained on mirrored pictures has them. The jitter is small, because the
model smooths. All in all a landmark is 4 to 5 pixels off on average. The model's own depths are good to a decimetre and
show half of what is there.
"""

import numpy as np
from skinned_person import Array

from camera_client.frame import Intrinsics
from camera_client.landmarks import COUNT, HIPS, TRACKED, Landmarks

FIXED = np.array([[-2.8, -5.2], [-2.6, 0.1], [1.6, -0.6], [-2.0, -0.3]])
"""Mean errors of the left side [pixel]: shoulder and hip outward and down, elbow and wrist along and across a limb."""
PERSONAL = 1.0
"""Standard deviation of the part that differs from person to person, along each axis [pixel]."""
POSTURAL = np.array([[1.7, 1.5], [2.0, 1.3], [2.2, 1.9], [1.4, 1.2]])
"""Standard deviations of the part that changes with the posture, in the same directions [pixel], of limbs across the
view."""
POINTING = np.array([1.5, 2.0, 0.4, 0.0])
"""How much more it is, as a factor less 1, where a limb at the joint points at the camera."""
SLOW_JITTER, JITTER = 0.5, 0.3
"""Standard deviations of the rest, with a memory and without one [pixel]."""
DEPTH_FIXED, DEPTH_POSTURAL = 0.05, 0.10
"""Standard deviations of the model's own depths [m]."""

_COMPRESSION = 0.45
_JITTER_TIME = 0.15
_POSTURE_SCALE = 3.0
"""How fast the postural part changes, over the body's extent [rad/m]."""
_N = len(TRACKED)
_TWINS = np.array([0, 1, 2, 0, 1, 2, 3, 3])
"""Which errors a tracked joint has: those of shoulder, elbow, wrist or hip."""
_MIRROR = np.where(np.isin(np.arange(_N), (3, 4, 5, 7)), -1.0, 1.0)
"""What a right-hand joint does with the first axis."""


class ModelNoise:
    """One model's errors with one person, drawn from a generator."""

    def __init__(self, rng: np.random.Generator, intrinsics: Intrinsics) -> None:
        self._rng = rng
        self._intrinsics = intrinsics
        self._fixed = (FIXED + PERSONAL * rng.standard_normal((4, 2)))[_TWINS]
        self._depth_fixed = DEPTH_FIXED * rng.standard_normal(4)[_TWINS]
        self._turns = _POSTURE_SCALE * rng.standard_normal((4, 3, 9))[_TWINS]
        self._phases = rng.uniform(0.0, 2.0 * np.pi, (4, 3))[_TWINS]
        self._jitter = np.zeros((_N, 2))

    def look(self, joints: Array, dt: float, hidden: tuple[int, ...] = ()) -> Landmarks:
        """Landmarks of a frame.

        Args:
            joints: True joints, optical frame, shape (8, 3) [m].
            dt: Time since the last frame [s].
            hidden: Arms of which elbow and wrist are covered, 0 left and 1 right: their landmarks are wild guesses.
        """
        rng = self._rng
        pixels = self._intrinsics.project(joints)
        axes = _axes(pixels)
        waves = np.empty((_N, 3))
        for j in range(_N):
            arm = joints[0:3] if j in (0, 1, 2, 6) else joints[3:6]
            posture = ((arm - joints[HIPS].mean(axis=0)) * (_MIRROR[j], 1.0, 1.0)).ravel()
            waves[j] = np.sqrt(2.0) * np.sin(self._turns[j] @ posture + self._phases[j])
        kept = np.exp(-dt / _JITTER_TIME)
        self._jitter = kept * self._jitter + np.sqrt(1.0 - kept * kept) * SLOW_JITTER * rng.standard_normal((_N, 2))
        growth = 1.0 + POINTING[_TWINS] * _pointing(joints)
        lasting = self._fixed + POSTURAL[_TWINS] * growth[:, None] * waves[:, :2]
        pixels += np.einsum("jki,jk->ji", axes, lasting) + self._jitter + JITTER * rng.standard_normal((_N, 2))
        visibility = np.full(_N, 0.98)
        for arm in hidden:
            covered = [3 * arm + 1, 3 * arm + 2]
            pixels[covered] += 30.0 * rng.standard_normal((2, 2))
            visibility[covered] = rng.uniform(0.0, 0.2, 2)
        world = joints - joints[HIPS].mean(axis=0)
        world[:, 2] = _COMPRESSION * world[:, 2] + self._depth_fixed + DEPTH_POSTURAL * waves[:, 2]
        out = Landmarks(np.full((COUNT, 2), np.nan), np.zeros(COUNT), np.full((COUNT, 3), np.nan))
        out.pixels[TRACKED], out.visibility[TRACKED] = pixels, visibility
        assert out.world is not None
        out.world[TRACKED] = world
        return out


def _pointing(joints: Array) -> Array:
    """How far the limbs at each joint point at the camera, 0 to 1, shape (8,)."""
    out = np.zeros(_N)
    for shoulder in (0, 3):
        arm = joints[shoulder : shoulder + 3]
        limbs = np.diff(arm, axis=0)
        towards = -(limbs * arm[:2]).sum(axis=1)
        upper, fore = (towards / np.linalg.norm(limbs, axis=1) / np.linalg.norm(arm[:2], axis=1)).clip(0.0, 1.0)
        out[shoulder : shoulder + 3] = upper, max(upper, fore), fore
    return out


def _axes(pixels: Array) -> Array:
    """The two directions that errors of each joint are given in, shape (8, 2, 2)."""
    axes = np.tile(np.eye(2), (_N, 1, 1))
    axes[:, 0, 0] = _MIRROR
    for joint in (1, 2, 4, 5):
        limb = pixels[joint] - pixels[joint - 1]
        along = limb / max(float(np.linalg.norm(limb)), 10.0)
        axes[joint] = along, _MIRROR[joint] * np.array([-along[1], along[0]])
    return axes
