"""Where a global solve starts: postures spread over an arm's joints, the one with the nearest wrist first."""

import math

import numpy as np

from ik_service.chains import ArmChain

COUNT = 1000
"""Postures of an arm's table."""

POSITION_SCALE = 0.15
"""Distance of two wrists that weighs as much as `ROTATION_SCALE` [m]."""

ROTATION_SCALE = 1.0
"""Angle between two wrists that weighs as much as `POSITION_SCALE` [rad]."""

WILD = 256
"""Postures for targets that none of those serves."""

_SCALE = np.tile([1.0 / (math.sqrt(2.0) * ROTATION_SCALE)] * 3 + [1.0 / POSITION_SCALE], 3)
"""What the first three rows of a pose are multiplied with. Rotation matrices an angle apart are sqrt(8) sin(angle / 2)
apart."""


class Seeds:
    """The starts of an arm.

    Postures follow a Halton sequence over the joint limits, so a table is the same in every run. The nearest wrist is
    measured by positions and rotation matrices as points of one flat space.
    """

    def __init__(self, chain: ArmChain) -> None:
        """Tabulate the wrists of the postures.

        Args:
            chain: The arm.
        """
        self._postures = spread(chain, COUNT)
        rng = np.random.default_rng(0)
        anywhere, limits = rng.uniform(-0.2, 1.2, (WILD, chain.n)), (0.0, 1.0)
        self._wild = chain.lower + np.clip(anywhere, *limits) * (chain.upper - chain.lower)
        self._points = chain.wrists(self._postures)[:, :3].reshape(COUNT, 12) * _SCALE
        self._squares = (self._points**2).sum(1)

    def nearest(self, T_mount_wrist: np.ndarray) -> tuple[np.ndarray, float]:
        """Choose the best start for a target.

        Args:
            T_mount_wrist: Target in the frame the arm is mounted in, shape (4, 4).

        Returns:
            Joint positions [rad], shape (n,), and the squared distance of their wrist from the target.
        """
        point = T_mount_wrist[:3].ravel() * _SCALE
        distances = self._squares - 2.0 * (self._points @ point)  # without what all have in common
        best = distances.argmin()
        return self._postures[best], float(distances[best] + point @ point)

    def sorted(self, T_mount_wrist: np.ndarray, count: int) -> np.ndarray:
        """Choose many starts for a target.

        Args:
            T_mount_wrist: Target in the frame the arm is mounted in, shape (4, 4).
            count: How many, at most COUNT.

        Returns:
            Joint positions [rad], the nearest wrist first, shape (count, n).
        """
        distances = self._squares - 2.0 * (self._points @ (T_mount_wrist[:3].ravel() * _SCALE))
        chosen = np.argpartition(distances, count - 1)[:count]
        return self._postures[chosen[np.argsort(distances[chosen])]]

    def wild(self, k: int) -> np.ndarray:
        """The k-th of a series of postures all over the range, every joint at a limit as often as not [rad]."""
        return self._wild[k % len(self._wild)]


def squared_distance(position_error: float, rotation_error: float) -> float:
    """How far apart two wrists are for the purpose of starts, from their distance [m] and angle [rad]."""
    return (position_error / POSITION_SCALE) ** 2 + (2.0 * math.sin(0.5 * rotation_error) / ROTATION_SCALE) ** 2


def spread(chain: ArmChain, count: int) -> np.ndarray:
    """Points spread evenly over the middle 80 % of the joint limits, shape (count, n): a Halton sequence."""
    primes = [p for p in range(2, 8 * chain.n) if all(p % d for d in range(2, p))][: chain.n]
    unit = np.array([[_radical_inverse(k, prime) for prime in primes] for k in range(1, count + 1)]).reshape(
        count, chain.n
    )
    return chain.lower + (0.1 + 0.8 * unit) * (chain.upper - chain.lower)


def _radical_inverse(k: int, base: int) -> float:
    """Digits of k in a base, mirrored at the point (J. H. Halton, Numerische Mathematik 2, 1960)."""
    value, digit = 0.0, 1.0 / base
    while k:
        value += digit * (k % base)
        k //= base
        digit /= base
    return value
