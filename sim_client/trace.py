"""What happened in a run, tick by tick: the material of reports and pictures."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from ik_client import LoopState, TickReport
from ik_proto import Array

KEPT_TICKS = 90_000
"""How many ticks a trace keeps: half an hour at 50 Hz. A longer run forgets its beginning."""


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """One control tick.

    Attributes:
        index: Its number, from 0.
        sim_time: Simulated time after it [s].
        report: What the teleop loop did.
        qpos: Joint positions of the whole model after it, shape (nq,).
        wrists: Wrist poses `T_pelvis_wrist` after it, left and right, shape (4, 4) each [m].
        lateness: How long after its scheduled instant it began [s].
        busy: How long loop and physics took, the wait for the service included [s].
    """

    index: int
    sim_time: float
    report: TickReport
    qpos: Array
    wrists: tuple[Array, Array]
    lateness: float
    busy: float

    @property
    def targets(self) -> tuple[Array | None, Array | None]:
        """Target of each wrist, left and right, shape (4, 4) [m]; None where the arm followed no hand."""
        return self.report.targets

    @property
    def holding(self) -> bool:
        """Whether both arms came to rest and held."""
        return self.report.state is LoopState.HOLDING


class Trace:
    """The last ticks of a run, oldest first."""

    def __init__(self, kept: int = KEPT_TICKS) -> None:
        """Start empty."""
        self._ticks: deque[Tick] = deque(maxlen=kept)

    def observe(self, tick: Tick) -> None:
        """Keep a tick."""
        self._ticks.append(tick)

    def __iter__(self) -> Iterator[Tick]:
        """All ticks, oldest first."""
        return iter(self._ticks)

    def __len__(self) -> int:
        """Number of ticks kept."""
        return len(self._ticks)

    def last(self, count: int) -> list[Tick]:
        """The newest ticks, oldest first."""
        return [self._ticks[i] for i in range(max(len(self._ticks) - count, 0), len(self._ticks))]
