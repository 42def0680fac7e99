"""Orientation of both wrists from the bend of the elbows.

    x = f,    y = x × u / |x × u|,    z = x × y        u from shoulder to elbow, f from elbow to wrist

x is along the forearm and y along the elbow's axis, which is how the G1's wrists are turned at its zero posture. How
the hand is turned about the forearm is not seen; it is taken as not turned at all.

A straight arm has no such axis, and one that is nearly straight has a noisy one. There y is carried along with x by the
smallest rotation (parallel transport) and only follows what is measured as far as the elbow is bent, at a bounded rate.
An arm that begins straight has the axis of a hanging arm, y = left, carried to where it is.
"""

import math

import numpy as np

from camera_client.vectors import cross, dot, length, transport, unit
from ik_proto import Array

STRAIGHT = 0.12
"""Sine of the flexion below which nothing is measured."""
BENT = 0.34
"""Sine of the flexion above which the measurement counts in full."""

_TAU = 0.03
"""Time in which the measured axis is followed [s]."""
RATE = 10.0
"""Fastest turn about the forearm [rad/s]."""


def flexion_weight(u: Array, f: Array) -> Array:
    """How well the bend of the elbows defines their axes, 0 to 1, shape (n,), of unit directions of shape (n, 3)."""
    w = ((length(cross(f, u)) - STRAIGHT) / (BENT - STRAIGHT)).clip(0.0, 1.0)
    return w * w * (3.0 - 2.0 * w)


class WristBasis:
    """Follows the orientation of both wrists through frames."""

    def __init__(self) -> None:
        """Start with hanging arms."""
        self.reset()

    def reset(self) -> None:
        """Start anew."""
        self._x = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
        self._y = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
        self._begun = False

    def update(self, u: Array, f: Array, dt: float, confidence: Array) -> Array:
        """Take the directions of a frame.

        Args:
            u: Unit directions of the upper arms, left and right, shape (2, 3).
            f: Unit directions of the forearms, shape (2, 3).
            dt: Time since the last frame [s].
            confidence: How far they are to be trusted, 0 to 1, shape (2,).

        Returns:
            Rotations, shape (2, 3, 3), in the frame of the directions.
        """
        carried = transport(self._y, self._x, f)
        beside = cross(f, carried)
        seen = cross(f, u)
        angle = np.arctan2(dot(beside, seen), dot(carried, seen))
        weight = flexion_weight(u, f) * confidence
        if self._begun:
            angle = (weight * (1.0 - math.exp(-dt / _TAU)) * angle).clip(-RATE * dt, RATE * dt)
        else:
            angle = weight * angle
            self._begun = True
        y = np.cos(angle)[:, None] * carried + np.sin(angle)[:, None] * beside
        y = unit(y - f * dot(f, y)[:, None])
        self._x, self._y = f.copy(), y
        return np.array((f, y, cross(f, y))).transpose(1, 2, 0)
