"""The live table of a run, refreshed in the pause between ticks.

It is drawn by the thread that ticks, in the pause after a tick: a second thread would take the interpreter away from a
solve that is under way.
"""

import time
from collections.abc import Callable

from rich.live import Live
from rich.markup import escape
from rich.table import Table

from sim_client.poses import difference
from sim_client.report import ARMS, Spread, spread
from sim_client.robot import CONTROL_PERIOD
from sim_client.trace import Tick, Trace

_WINDOW_TICKS = 250
_REFRESH_TICKS = 12


class LiveTable:
    """Observer that shows latency, wrist errors and state of the last five seconds."""

    def __init__(self, live: Live, *, clock: Callable[[], float] = time.monotonic) -> None:
        """Draw into a display that is already on.

        Args:
            live: A display without automatic refresh.
            clock: The loop's clock [s].
        """
        self._live = live
        self._clock = clock
        self._recent = Trace(_WINDOW_TICKS)
        self._begin: float | None = None

    def observe(self, tick: Tick) -> None:
        """Take in a tick; now and then refresh the table."""
        self._recent.observe(tick)
        if self._begin is None:
            self._begin = tick.report.time
        if tick.index % _REFRESH_TICKS == 0:
            self._live.update(self._table(tick, self._begin), refresh=True)

    def _table(self, now: Tick, begin: float) -> Table:
        ticks = list(self._recent)
        reports = [tick.report for tick in ticks]
        factor = (now.index + 1) * CONTROL_PERIOD / max(self._clock() - begin, CONTROL_PERIOD)
        state = f"[yellow]holding: {escape(now.report.reason)}[/]" if now.holding else "[green]following[/]"
        table = Table(show_header=True, title=f"{now.sim_time:6.1f} s  {state}", title_justify="left")
        for column in ("last 5 s", "p50", "p99"):
            table.add_column(column, justify="left" if column == "last 5 s" else "right")
        _row(table, "solve in the service [us]", spread(r.solve_us for r in reports if r.solve_us is not None), 0)
        trips = spread(1e3 * r.round_trip for r in reports if r.reply and r.round_trip is not None)
        _row(table, "solve round trip [ms]", trips, 2)
        for arm, name in enumerate(ARMS):
            pairs = [(tick.wrists[arm], target) for tick in ticks if (target := tick.targets[arm]) is not None]
            errors = spread(1e3 * difference(*pair)[0] for pair in pairs)
            _row(table, f"{name} wrist off target [mm]", errors, 1)
        table.add_row("real-time factor", f"{factor:.3f}", "")
        return table


def _row(table: Table, name: str, values: Spread | None, digits: int) -> None:
    if values is None:
        table.add_row(escape(name), "-", "-")
    else:
        table.add_row(escape(name), f"{values.p50:.{digits}f}", f"{values.p99:.{digits}f}")
