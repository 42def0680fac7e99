"""From landmarks and depth to both arms in the operator's pelvis frame: one frame in, one estimate out.

    patches ─> depths on rays ─> Kalman filter ─> pelvis frame ─> limbs ─> rejoin ─> wrist orientation

- A frame without a credible body, or with somebody else's, moves nothing: both arms are held.
- An arm of which a joint is out of view, or that depth says is behind something, is held where it was. It comes back
  without a jump, see `rejoin`.
- A frame without depth is lifted by the pose model's own guess of the body, see `monocular`; the estimate says so.
- An arm that leaps, because a limb was taken to point at the camera and now away from it, goes there without a jump.
- Frames come in the order of their capture; one that does not is refused.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from camera_client.calibration import TYPICAL, Calibration
from camera_client.estimate import ArmsEstimate
from camera_client.frame import RgbdFrame
from camera_client.kalman import JointFilter, Mask
from camera_client.landmarks import ARMS, HIPS, SHOULDERS, TRACKED, Landmarks
from camera_client.leap_watch import LeapWatch
from camera_client.lift import Surfaces, lift, surfaces
from camera_client.operator_lock import OperatorLock
from camera_client.rejoin import Rejoin
from camera_client.torso import BodyFrame, Torso
from camera_client.vectors import between, unit
from camera_client.wrist_basis import WristBasis, flexion_weight

_LOST = 0.3
"""Time without measurement after which a joint may be anywhere [s]."""
_DOUBT = 0.1
"""Time for which an arm is followed that the camera does not see where it is placed [s]."""
_SURE, _UNSURE = 0.04, 0.12
"""Standard deviations of a wrist's position of full and of no confidence [m]."""
_ACCELERATION = np.array([6.0, 12.0, 12.0, 6.0, 12.0, 12.0, 4.0, 4.0])
"""Standard deviations of the joints' accelerations: a trunk is slower than a hand [m/s^2]."""
_HANGING = np.array([0.0, 0.0, -1.0])
"""Where the limbs of an arm are that was never seen."""
_NEVER = -math.inf


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """The arms as last shown."""

    shoulders: NDArray[np.float64]
    limbs: NDArray[np.float64]
    tracked: Mask


class Chain:
    """Follows both arms of one operator.

    Attributes:
        lock: Whose arms; release it to take somebody else's.
        latest: The last estimate; None before the first body.
    """

    def __init__(self, calibration: Calibration = TYPICAL) -> None:
        """Start without having seen anybody.

        Args:
            calibration: The operator.
        """
        self.lock = OperatorLock()
        self.latest: ArmsEstimate | None = None
        self._calibration = calibration
        self._filter = JointFilter(len(TRACKED), _ACCELERATION)
        self._torso = Torso(calibration.level_rotation(), calibration.hips_below)
        self._basis = WristBasis()
        self._rejoin = Rejoin()
        self._leap = LeapWatch()
        self._shown: _Shown | None = None
        self._time = _NEVER
        self._monocular = False
        self._doubt = np.zeros(2)
        self._measured = np.full(len(TRACKED), _NEVER)

    def update(
        self, frame: RgbdFrame, landmarks: Landmarks | None, on_lifted: Callable[[], None] = lambda: None
    ) -> ArmsEstimate | None:
        """Take a frame.

        Args:
            frame: What the camera saw.
            landmarks: What the pose model found in it; None for nothing.
            on_lifted: Called between the lift and the filter, for who measures how long they take.

        Returns:
            Both arms; None as long as nobody has been seen.

        Raises:
            ValueError: The frame is not newer than the last one.
        """
        dt = frame.t_capture - self._time
        if not dt > 0.0:
            raise ValueError(f"a frame of {frame.t_capture} s came after one of {self._time} s")
        dt = dt if math.isfinite(dt) else 0.0
        self._time = frame.t_capture
        self._filter.predict(dt)
        if landmarks is None or not landmarks.credible(*frame.size):
            return self._hold("nobody faces the camera")
        seen = surfaces(frame, landmarks, self._filter, self._calibration)
        if seen is None:
            return self._hold("no depth on the body")
        self._monocular = frame.depth is None
        if not self.lock.admit(seen.place, self._time):
            return self._hold("somebody else is before the camera")
        lifted = lift(seen, landmarks, self._filter, self._calibration, self._torso.shoulders())
        hidden = seen.seen[ARMS].reshape(2, 3).all(axis=1) & ~lifted.confirmed
        self._doubt = (self._doubt + np.where(hidden, dt, -2.0 * dt)).clip(0.0, 2.0 * _DOUBT)
        # The shoulders belong to the trunk.
        measured = lifted.measured.copy()
        measured[ARMS].reshape(2, 3)[hidden | (self._doubt > _DOUBT), 1:] = False
        self._measured[measured] = self._time
        self._filter.forget(self._time - self._measured > _LOST)
        on_lifted()
        anew = self._filter.update(lifted.positions, lifted.sigma, measured)
        return self._show(seen, anew, dt)

    def _show(self, seen: Surfaces, anew: Mask, dt: float) -> ArmsEstimate | None:
        known = self._filter.known
        if not known[SHOULDERS].all():
            return self._hold("the shoulders are not seen")
        body = self._torso.update(self._filter.position, known, dt, seen.sure, seen.front)
        tracked = np.asarray((seen.seen & known)[ARMS].reshape(2, 3).all(axis=1)) & (self._doubt <= _DOUBT)
        joints = body.points(self._filter.position[ARMS]).reshape(2, 3, 3)
        shoulders, limbs = joints[:, 0], unit(joints[:, 1:] - joints[:, :-1])
        leapt = self._leap.update(limbs, self._calibration.lengths, dt)
        if self._shown is not None:
            # The hips move the pelvis frame, and with it both arms.
            back = leapt | ~self._shown.tracked | anew[ARMS].reshape(2, 3).any(axis=1) | anew[HIPS].any()
            if (tracked & back).any():
                self._rejoin.begin(tracked & back, (self._shown.shoulders, shoulders), (self._shown.limbs, limbs))
            held = ~tracked[:, None]
            shoulders, limbs = self._rejoin.apply(shoulders, limbs, dt)
            shoulders = np.where(held, self._shown.shoulders, shoulders)
            limbs = np.where(held[..., None], self._shown.limbs, limbs)
        elif tracked.any():
            limbs = np.where(tracked[:, None, None], limbs, _HANGING)
        else:
            return None
        self._shown = _Shown(shoulders, limbs, tracked)
        return self._estimate(body, tracked, dt)

    def _estimate(self, body: BodyFrame, tracked: Mask, dt: float) -> ArmsEstimate:
        assert self._shown is not None
        shoulders, limbs = self._shown.shoulders, self._shown.limbs
        sigma = self._filter.sigma[ARMS].max(axis=1).reshape(2, 3)
        trust = ((_UNSURE - sigma) / (_UNSURE - _SURE)).clip(0.0, 1.0) * tracked[:, None]
        joints = np.empty((2, 3, 3))
        joints[:, 0] = shoulders
        joints[:, 1:] = self._calibration.lengths[..., None] * limbs
        joints = joints.cumsum(axis=1)
        velocity = self._filter.velocity
        base = between(*velocity[HIPS if self._filter.known[HIPS].all() else SHOULDERS])
        velocity = body.directions(velocity[ARMS] - base).reshape(2, 3, 3)
        self.latest = ArmsEstimate(
            t_capture=self._time,
            tracked=tracked,
            joints=joints,
            velocity=np.where(tracked[:, None, None], velocity, 0.0),
            limbs=limbs,
            R_pelvis_wrist=self._basis.update(limbs[:, 0], limbs[:, 1], dt, trust[:, 1:].min(axis=1)),
            confidence=trust[:, 2],
            bend=flexion_weight(limbs[:, 0], limbs[:, 1]) * trust[:, 1],
            elbow_confidence=trust[:, 1],
            yaw=body.yaw,
            note="" if tracked.all() else _out_of_view(tracked),
            monocular=self._monocular,
        )
        return self.latest

    def _hold(self, note: str) -> ArmsEstimate | None:
        """Nothing new: both arms stay where they are."""
        self._filter.forget(self._time - self._measured > _LOST)
        if not self._filter.known.any():
            self._torso.forget()
        if self.latest is None or self._shown is None:
            return None
        nothing, none = np.zeros(2), np.zeros(2, dtype=bool)
        self._shown = replace(self._shown, tracked=none)
        self.latest = replace(
            self.latest,
            t_capture=self._time,
            tracked=none,
            velocity=np.zeros((2, 3, 3)),
            confidence=nothing,
            bend=nothing,
            elbow_confidence=nothing,
            note=note,
        )
        return self.latest


def _out_of_view(tracked: Mask) -> str:
    arms = [side for side, there in zip(("left", "right"), tracked.tolist(), strict=True) if not there]
    return f"the {' and the '.join(arms)} arm is out of view" if len(arms) == 1 else "both arms are out of view"
