"""Arms that are nearly straight are taken to be straighter than they look.

To which side a nearly straight arm bends is hardly seen: depths are wrong by centimetres, and so a bend of ten degrees
comes and goes, and changes its side. A robot cannot follow that. Its elbow bends one way only; for the other side it
has to turn its whole arm about itself, or bend its elbow backwards, where it then stays until it is straight again.

    bend' = bend * bend² / (bend² + NOISE²)

This is the share of what is seen that is not noise (N. Wiener), bend by bend. Both limbs turn towards the line from
shoulder to wrist, and the hand stays in its direction. An arm that is well bent hardly changes: 90 degrees become 89.
"""

import numpy as np

from camera_client.vectors import cross, dot, rotate, transport, unit
from ik_proto import Array

NOISE = np.radians(10.0)
"""Bend that as often as not is none [rad]. On rendered people, with the noise of an OAK, bends of 3 to 8 degrees are
seen as anything from 2 to 15."""


def straightened(limbs: Array, R_pelvis_wrist: Array, upper: float, fore: float) -> tuple[Array, Array]:
    """Take out of both arms what is probably no bend.

    Args:
        limbs: Unit directions of upper arm and forearm, shape (2, 2, 3).
        R_pelvis_wrist: Orientations of the wrists, x along the forearm, shape (2, 3, 3).
        upper: Length of the upper arm whose hand shall stay in its direction [m].
        fore: Length of its forearm [m].

    Returns:
        The same of straighter arms, new arrays. The hand turns with its forearm.
    """
    u, f = limbs[:, 0], limbs[:, 1]
    bend = np.arccos(dot(u, f).clip(-1.0, 1.0))
    bend *= bend**2 / (bend**2 + NOISE**2)
    # The triangle of shoulder, elbow and wrist: how far the upper arm is from the line, and the forearm beyond it.
    before = np.arctan2(fore * np.sin(bend), upper + fore * np.cos(bend))
    line, axis = unit(upper * u + fore * f), unit(cross(u, f))
    turns = np.stack([-before, bend - before], axis=1)[..., None] * axis[:, None]
    straighter = rotate(line[:, None], turns)
    columns = np.swapaxes(R_pelvis_wrist, 1, 2)
    turned = transport(columns, f[:, None], straighter[:, 1, None])
    return straighter, np.swapaxes(turned, 1, 2)
