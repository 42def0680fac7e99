"""The frame that hand poses are given in: where the operator is, to a robot that stands somewhere else.

| reference | the hands are given                         | the head turns             | the operator walks       |
|-----------|---------------------------------------------|----------------------------|--------------------------|
| standing  | in a frame that stands still from the first | nothing changes            | the hands move; where a  |
|           | grip to the last release: forward is where  |                            | neck is known, the frame |
|           | the head looked at the grip                 |                            | comes along              |
| head      | from the head, 0.15 m forward, 0.45 m up:   | nothing, but for what the  | nothing changes          |
|           | the seeds' way, for absolute targets        | eyes move about the neck   |                          |

Both work on looks in the robot's axes and give `Hands` for the teleop loop. They are asked once per tick, as a hand
that is lost for a moment must be seen to be.
"""

import math
from dataclasses import replace
from typing import Protocol

import numpy as np

from ik_client.hand import HandSample
from ik_client.types import Hands
from ik_proto import Array
from xr_client.calibration import Neck
from xr_client.look import Look

PELVIS_HEAD = np.array([0.15, 0.0, 0.45])
"""The head seen from the pelvis, as the seeds have it, shape (3,) [m]: 0.15 m forward and 0.45 m up, for everybody."""
PELVIS_HEAD.flags.writeable = False

_LEVEL = 0.2
"""Horizontal part of the view below which an operator looks up or down, and forward cannot be told."""


class Reference(Protocol):
    """Gives hands in a frame of its own."""

    def hands(self, look: Look) -> Hands:
        """Take the look of this tick; the same one may come in several ticks."""
        ...


class HeadReference:
    """The seeds' reference: head position removed, head rotation ignored, constants of xr_teleoperate's tv_wrapper.py.

    Unlike the seeds, which go on with constant poses where a head or a hand is missing, it says that it is.
    """

    def hands(self, look: Look) -> Hands:
        """Wrists in the pelvis frame, as far as the head is a robot's."""
        head = look.head
        if head is None:
            return Hands(_lost(look.left), _lost(look.right))
        shift = PELVIS_HEAD - head[:3, 3]
        return Hands(_shifted(look.left, shift), _shifted(look.right, shift))


class StandingReference:
    """The default reference: a yaw-only anchor under the head that stands still while an operator grips.

    - Without a grip the anchor follows the head. It stays from the first grip until both hands are seen to let go, so
      that both arms have the same anchor. A hand whose grip cannot be told keeps it.
    - When it begins to follow again, both hands count as lost in that tick: they are somewhere else in its frame.
    - With a known neck the anchor's place, not its direction, goes on following the neck while an operator grips.
    """

    def __init__(self, neck: Neck | None = None) -> None:
        """Start without an anchor.

        Args:
            neck: Where the operator's head turns about; None lets the anchor stand where it was at the grip.
        """
        self._neck = neck
        self._anchor: Array | None = None
        self._held = [False, False]
        self._standing = False

    def hands(self, look: Look) -> Hands:
        """Wrists in the anchor's frame, x forward, y left, z up."""
        for side, sample in enumerate(look.wrists):
            if sample is not None and sample.grip is not None:
                self._held[side] = sample.grip
        was_standing, self._standing = self._standing, any(self._held)
        if look.head is not None:
            if not self._standing:
                self._anchor = self._under(look.head)
            elif self._neck is not None and self._anchor is not None:
                self._anchor = _anchor(self._anchor[:3, :3], self._neck.point(look.head))
        unknown = self._anchor is None or (self._neck is not None and look.head is None)
        if self._anchor is None or unknown or (was_standing and not self._standing):
            return Hands(_lost(look.left), _lost(look.right))
        return Hands(_within(look.left, self._anchor), _within(look.right, self._anchor))

    def _under(self, head: Array) -> Array | None:
        """The anchor for this head, `T_room_anchor`; with the direction as before where the head looks up or down."""
        place = self._neck.point(head) if self._neck else head[:3, 3]
        x, y = head[0, 0], head[1, 0]
        level = math.hypot(x, y)
        if level >= _LEVEL:
            c, s = x / level, y / level
            return _anchor(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), place)
        return None if self._anchor is None else _anchor(self._anchor[:3, :3], place)


def _anchor(R: Array, place: Array) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, place
    return T


def _within(sample: HandSample | None, T_room_anchor: Array) -> HandSample | None:
    if sample is None:
        return None
    R, place = T_room_anchor[:3, :3], T_room_anchor[:3, 3]
    T = sample.pose.copy()
    T[:3, :3] = R.T @ sample.pose[:3, :3]
    T[:3, 3] = R.T @ (sample.pose[:3, 3] - place)
    return replace(sample, pose=T)


def _shifted(sample: HandSample | None, shift: Array) -> HandSample | None:
    if sample is None:
        return None
    T = sample.pose.copy()
    T[:3, 3] += shift
    return replace(sample, pose=T)


def _lost(sample: HandSample | None) -> HandSample | None:
    return None if sample is None else replace(sample, tracked=False)
