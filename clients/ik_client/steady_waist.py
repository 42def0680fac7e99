"""The measured waist without its swing: what the arms make up for.

Targets stand in the pelvis frame, so a bent waist is made up for by the arms. But arms that move push the waist back,
and a waist that is held by springs swings for a while (a G1's at 300 N m/rad with about 3 Hz, hardly damped). Arms that
make up for each swing, one delay later, feed it: with outstretched arms the whole body of the simulated robot rocked by
half a radian with the hands still. So only what lasts is made up for, and the swing is left to die away.

A critically damped low-pass of second order: at 3 Hz it lets a twentieth pass, and a second after a step nine tenths of
it are made up for.
"""

import math

import numpy as np

from ik_proto import Array

TIME_CONSTANT = 0.25
"""Of each of the two stages [s]."""

LONGEST_GAP = 1.0
"""Time without a measurement after which it begins anew [s]."""


class SteadyWaist:
    """Filters the waist joints of one robot."""

    def __init__(self, time_constant: float = TIME_CONSTANT) -> None:
        """Start without a measurement.

        Args:
            time_constant: Of each stage [s].
        """
        self._time_constant = time_constant
        self._stages: tuple[Array, Array] | None = None
        self._time = -math.inf

    def update(self, waist: Array | None, now: float) -> Array | None:
        """Take a measurement.

        Args:
            waist: Waist joints, shape (w,) [rad]; None where the waist stays straight.
            now: Time [s], monotonic.

        Returns:
            Where they stand but for their swing, shape (w,) [rad]; what is no measurement is given back as it came.
        """
        if waist is None or not np.isfinite(waist).all():
            self._stages = None
            return waist
        gap, self._time = now - self._time, now
        if self._stages is None or len(self._stages[0]) != len(waist) or not 0.0 <= gap <= LONGEST_GAP:
            self._stages = (waist, waist)
            return waist
        share = -math.expm1(-gap / self._time_constant)
        first = self._stages[0] + share * (waist - self._stages[0])
        second = self._stages[1] + share * (first - self._stages[1])
        self._stages = (first, second)
        return second
