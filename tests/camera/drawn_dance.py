"""Dances drawn at random: postures that an arm can take, held still or passed through, a wave and a turn.

An upper arm may point anywhere but far behind or far across, the elbow bends up to 140 degrees, and the upper arm turns
about itself by up to 90 degrees to either side of where it has the forearm of a hanging arm forward. Hands stay out of
trunk and head. A quarter of the postures is held for a second or more, by one arm or both.
"""

import numpy as np
from choreography import Choreography, Posture
from skinned_person import Array, rotation_about, smallest_rotation

_UPPER, _FORE = 0.29, 0.25
_SHOULDER = np.array([0.0, 0.175, 0.48])
_MOST_BEND = np.radians(140.0)
_MOST_ROLL = np.radians(90.0)
_DOWN, _FORWARD, _LEFT = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
_T = "T"


def drawn_dance(seed: int, duration: float = 27.0) -> Choreography:
    """A dance that begins with a T pose of two seconds for the calibration.

    Args:
        seed: Two dances of the same seed are the same.
        duration: About how long it takes [s].
    """
    rng = np.random.default_rng([seed, 6])
    keys: list[tuple[float, str | Posture, str | Posture]] = [(0.0, _T, _T), (2.0, _T, _T)]
    wave = turn = (0.0, 0.0)
    wave_at, turn_at = rng.uniform(0.2, 0.5) * duration, rng.uniform(0.55, 0.8) * duration
    t = 2.0
    left, right = _T, _T
    while t < duration:
        t += rng.uniform(0.7, 1.4)
        left = left if rng.random() < 0.2 else drawn_posture(rng)
        right = right if rng.random() < 0.2 else drawn_posture(rng)
        waving = wave == (0.0, 0.0) and t > wave_at
        if waving:
            right = _to_wave(rng)
        keys.append((t, left, right))
        if waving:
            wave = (t, t + 4.0)
            t += 4.0
            keys.append((t, left, right))
        elif turn == (0.0, 0.0) and t > turn_at:
            turn = (t, t + 3.0)
            t += 3.0
            # The arms move on while the body turns.
            left = drawn_posture(rng)
            keys.append((t, left, right))
        elif rng.random() < 0.6:
            t += rng.uniform(0.3, 2.0)
            keys.append((t, left, right))
    angle = float(np.radians(rng.uniform(15.0, 30.0)))
    return Choreography(tuple(keys), wave, turn, (0.3, 1.8), float(rng.uniform(0.8, 1.4)), angle)


def drawn_posture(rng: np.random.Generator) -> Posture:
    """A posture of the left arm."""
    while True:
        u = rng.standard_normal(3)
        u /= np.linalg.norm(u)
        bend, roll = rng.uniform(0.0, _MOST_BEND), rng.uniform(-_MOST_ROLL, _MOST_ROLL)
        axis = rotation_about(u, roll) @ smallest_rotation(_DOWN, u) @ _LEFT
        f = rotation_about(axis, -bend) @ u
        if _possible(u, f):
            return (u[0], u[1], u[2]), (f[0], f[1], f[2])


def _possible(u: Array, f: Array) -> bool:
    if u[0] < -0.35 or u[1] < -0.25 or u[2] > 0.9:
        return False
    elbow = _SHOULDER + _UPPER * u
    for share in (0.5, 1.0, 1.3):
        hand = elbow + share * _FORE * f
        behind = hand[0] < 0.17 and hand[1] < 0.26 and hand[2] < 0.60
        head = np.linalg.norm(hand - (0.05, 0.0, 0.68)) < 0.20
        if behind or head or hand[0] < -0.25:
            return False
    return True


def _to_wave(rng: np.random.Generator) -> Posture:
    """About a goalpost, from where a forearm swings to either side."""
    u = np.array([0.1, 1.0, -0.1]) + 0.2 * rng.standard_normal(3)
    f = np.array([0.2, 0.0, 1.0]) + 0.15 * rng.standard_normal(3)
    return (u[0], u[1], u[2]), (f[0], f[1], f[2])
