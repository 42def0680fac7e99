"""Timing for machines that do other things too."""

import time
from collections.abc import Callable, Mapping

import numpy as np

BLOCK = 50
"""Calls that a setting makes in one go."""

WARM_UP_S = 5e-3
"""Untimed calls before each block."""


def in_turns(
    calls: Mapping[str, Callable[[int], None]], count: int, advance: Callable[[int], None] = lambda _: None
) -> dict[str, np.ndarray]:
    """Time every call for each index, block by block in turns, so that all settings see the same machine.

    Args:
        calls: What to time, by setting; given the index.
        count: Number of indices.
        advance: Called with the number of indices done by all.

    Returns:
        Time of each call [us], shape (count,), by setting.
    """
    times = {name: np.empty(count) for name in calls}
    for turn, begin in enumerate(range(0, count, BLOCK)):
        names = list(calls)
        shift = turn % len(names)
        for name in names[shift:] + names[:shift]:
            _warm_up(calls[name], begin)
            for index in range(begin, min(begin + BLOCK, count)):
                before = time.perf_counter_ns()
                calls[name](index)
                times[name][index] = (time.perf_counter_ns() - before) / 1e3
        advance(min(BLOCK, count - begin))
    return times


def _warm_up(call: Callable[[int], None], index: int) -> None:
    end = time.perf_counter() + WARM_UP_S
    while time.perf_counter() < end:
        call(index)
