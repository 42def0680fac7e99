"""What the rendered person does: postures in time, in the robot's pelvis axes.

A posture is the directions of an arm's upper arm and forearm, for the left arm; the right one mirrors it. It goes by
its name or as it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from skinned_person import Array, rotation_about

Posture = tuple[tuple[float, float, float], tuple[float, float, float]]

POSTURES: dict[str, Posture] = {
    "hang": ((-0.02, 0.15, -1.0), (0.12, 0.12, -1.0)),
    "T": ((0.0, 1.0, 0.02), (0.05, 1.0, 0.02)),
    "goal": ((0.05, 1.0, 0.0), (0.05, 0.05, 1.0)),
    "e90": ((0.0, 0.12, -1.0), (1.0, 0.02, 0.0)),
    "occluded": ((0.5, 0.15, -0.85), (1.0, 0.0, -0.02)),
    "reach": ((1.0, 0.12, -0.05), (1.0, 0.02, 0.03)),
    "chest": ((0.35, 0.45, -0.85), (0.5, -0.85, 0.25)),
    "e90out": ((0.3, 0.8, -0.5), (1.0, -0.1, 0.1)),
    "side": ((0.2, 0.7, -0.7), (0.5, 0.7, 0.3)),
    "raised": ((0.25, 0.4, 0.88), (0.2, 0.1, 1.0)),
}
"""Left arm: upper arm, forearm. In "occluded" the hand is before the elbow."""

_MIRROR = np.array([1.0, -1.0, 1.0])
_WAVE_ANGLE = np.radians(45.0)


@dataclass(frozen=True)
class Choreography:
    """A sequence of postures.

    Attributes:
        keys: Time [s] and posture of the left and the right arm; in between they change smoothly.
        wave: Begin and end of a wave of the right forearm, 45 degrees to either side [s].
        turn: Begin and end of a turn of the body to either side [s].
        t_pose: Begin and end of the T pose on which an operator is calibrated [s].
        wave_rate: Of the wave [Hz].
        turn_angle: To either side [rad].
    """

    keys: Sequence[tuple[float, str | Posture, str | Posture]]
    wave: tuple[float, float] = (0.0, 0.0)
    turn: tuple[float, float] = (0.0, 0.0)
    t_pose: tuple[float, float] = (0.0, 0.0)
    wave_rate: float = 1.2
    turn_angle: float = float(np.radians(25.0))

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return self.keys[-1][0]

    def at(self, t: float) -> tuple[Array, Array, float, Array]:
        """Directions of upper arms and forearms, shape (2, 3) each, the yaw [rad] and where the pelvis sways [m]."""
        k = max(i for i in range(len(self.keys) - 1) if self.keys[i][0] <= t)
        (t0, *before), (t1, *after) = self.keys[k], self.keys[k + 1]
        x = min(max((t - t0) / (t1 - t0), 0.0), 1.0)
        s = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        arms = np.empty((2, 2, 3))
        for arm in range(2):
            for limb in range(2):
                a, b = (np.array(_posture(names[arm])[limb]) for names in (before, after))
                arms[arm, limb] = _between(a / np.linalg.norm(a), b / np.linalg.norm(b), s)
        arms[1] *= _MIRROR
        begin, end = self.wave
        if begin <= t < end:
            grown = min(1.0, (t - begin) / 0.3, (end - t) / 0.3)
            angle = _WAVE_ANGLE * grown * np.sin(2.0 * np.pi * self.wave_rate * (t - begin))
            arms[1, 1] = rotation_about(np.array([1.0, 0.0, 0.0]), angle) @ arms[1, 1]
        begin, end = self.turn
        yaw = 0.0
        if begin < end and begin <= t <= end:
            yaw = self.turn_angle * np.sin(2.0 * np.pi * (t - begin) / (end - begin))
        return arms[:, 0], arms[:, 1], yaw, np.array([0.0, 0.02 * np.sin(2.0 * np.pi * 0.25 * t), 0.0])


def _posture(posture: str | Posture) -> Posture:
    return POSTURES[posture] if isinstance(posture, str) else posture


def _between(a: Array, b: Array, s: float) -> Array:
    angle = np.arccos(np.clip(a @ b, -1.0, 1.0))
    if angle < 1e-4:
        return b
    return (np.sin((1.0 - s) * angle) * a + np.sin(s * angle) * b) / np.sin(angle)


FULL = Choreography(
    keys=(
        (0.0, "hang", "hang"),
        (2.0, "hang", "hang"),
        (3.0, "T", "T"),
        (4.2, "T", "T"),
        (5.2, "goal", "goal"),
        (6.2, "goal", "goal"),
        (7.2, "e90", "e90"),
        (8.7, "e90", "e90"),
        (9.5, "occluded", "occluded"),
        (11.0, "occluded", "occluded"),
        (12.0, "reach", "reach"),
        (13.3, "reach", "reach"),
        (14.3, "chest", "hang"),
        (15.5, "chest", "hang"),
        (16.5, "hang", "goal"),
        (20.5, "hang", "goal"),
        (21.3, "side", "e90out"),
        (22.0, "side", "e90out"),
        (23.0, "e90", "side"),
        (25.0, "e90", "side"),
        (26.0, "hang", "hang"),
        (27.0, "hang", "hang"),
    ),
    wave=(16.5, 20.5),
    turn=(22.0, 25.0),
    t_pose=(3.1, 4.2),
)
"""27 s: hanging, T, goalpost, forearms at the camera, elbows hidden by hands, reach, across the chest, wave, turn."""

SHORT = Choreography(
    keys=(
        (0.0, "hang", "hang"),
        (0.4, "hang", "hang"),
        (1.1, "e90", "T"),
        (1.7, "occluded", "T"),
        (2.2, "occluded", "goal"),
        (4.2, "side", "goal"),
        (5.0, "reach", "hang"),
        (5.5, "reach", "hang"),
    ),
    wave=(2.2, 4.2),
    turn=(0.0, 0.0),
)
"""5.5 s of the same."""
