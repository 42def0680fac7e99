"""The numbers of a run: computed from its trace, written as JSON, shown as a table."""

import json
import platform
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from rich.markup import escape
from rich.table import Table

from sim_client.poses import difference
from sim_client.realtime import Pace
from sim_client.trace import Tick, Trace

ARMS = ("left", "right")


@dataclass(frozen=True, slots=True)
class Spread:
    """How a quantity is distributed.

    Attributes:
        count: Number of values.
        p50: Median.
        p95: 95th percentile.
        p99: 99th percentile.
        max: Largest.
    """

    count: int
    p50: float
    p95: float
    p99: float
    max: float


@dataclass(frozen=True, slots=True)
class RunReport:
    """What a run showed.

    Attributes:
        seconds: Simulated time [s].
        ticks: Control ticks.
        real_time_factor: Simulated time over wall time.
        headroom: Simulated time over busy time.
        late_ticks: Ticks that ended after the next one was due.
        schedule_moves: How often the schedule was moved after a long gap.
        ticks_without_command: Ticks for which the robot got no command; counted at the robot.
        tracking_ticks: Ticks that followed.
        holding_ticks: Ticks in which both arms came to rest and held.
        hold_reasons: Ticks held for each reason.
        statuses: Answers of each status.
        largest_step: Largest change of a joint's command between two ticks [rad].
        round_trip_ms: Solve calls that were answered, at the client [ms].
        solve_us: Time the service spent solving [us].
        wrist_error_mm: Distance of each actual wrist from its target, while following [mm].
        wrist_error_deg: Angle between each actual wrist and its target, while following [deg].
        answer_error_mm: The part of it that the solver left, by its own account [mm].
        events: When it held and followed again.
        settings: What was run.
        machine: On what.
    """

    seconds: float
    ticks: int
    real_time_factor: float
    headroom: float
    late_ticks: int
    schedule_moves: int
    ticks_without_command: int
    tracking_ticks: int
    holding_ticks: int
    hold_reasons: dict[str, int]
    statuses: dict[str, int]
    largest_step: float
    round_trip_ms: Spread | None
    solve_us: Spread | None
    wrist_error_mm: dict[str, Spread | None]
    wrist_error_deg: dict[str, Spread | None]
    answer_error_mm: dict[str, Spread | None]
    events: list[str]
    settings: dict[str, object]
    machine: dict[str, str]

    def write(self, path: Path) -> None:
        """Write as JSON; folders are made."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(asdict(self), indent=2) + "\n", encoding="utf-8")


def spread(values: Iterable[float]) -> Spread | None:
    """Distribution of some values; None if there are none."""
    array = np.fromiter(values, dtype=np.float64)
    if not len(array):
        return None
    p50, p95, p99 = (float(p) for p in np.percentile(array, [50, 95, 99]))
    return Spread(len(array), p50, p95, p99, float(array.max()))


def summarise(
    trace: Trace,
    pace: Pace,
    *,
    ticks_without_command: int,
    events: list[str],
    settings: dict[str, object],
) -> RunReport:
    """Compute a report.

    Args:
        trace: Every tick.
        pace: How the run kept time.
        ticks_without_command: As counted by the robot.
        events: Lines announced during the run.
        settings: What was run, for the record.

    Returns:
        The report. Statistics cover the ticks the trace kept.
    """
    ticks = list(trace)
    following = [tick for tick in ticks if not tick.holding]
    errors = {arm: [difference(*pair) for pair in _pairs(following, i)] for i, arm in enumerate(ARMS)}
    answered = [tick.report for tick in ticks if tick.report.reply and tick.report.round_trip is not None]
    commands = np.array([tick.report.command.q for tick in ticks])
    return RunReport(
        seconds=pace.simulated,
        ticks=pace.ticks,
        real_time_factor=pace.real_time_factor,
        headroom=pace.headroom,
        late_ticks=pace.late_ticks,
        schedule_moves=pace.moved,
        ticks_without_command=ticks_without_command,
        tracking_ticks=len(ticks) - sum(tick.holding for tick in ticks),
        holding_ticks=sum(tick.holding for tick in ticks),
        hold_reasons=dict(Counter(tick.report.reason for tick in ticks if tick.holding)),
        statuses=dict(Counter(str(report.status) for report in answered)),
        largest_step=float(np.abs(np.diff(commands, axis=0)).max()) if len(commands) > 1 else 0.0,
        round_trip_ms=spread(1e3 * report.round_trip for report in answered if report.round_trip is not None),
        solve_us=spread(report.solve_us for report in answered if report.solve_us is not None),
        wrist_error_mm={arm: spread(1e3 * distance for distance, _ in errors[arm]) for arm in ARMS},
        wrist_error_deg={arm: spread(float(np.degrees(angle)) for _, angle in errors[arm]) for arm in ARMS},
        answer_error_mm={
            arm: spread(
                1e3 * float(t.report.position_error[i])
                for t in following
                if t.report.position_error is not None and t.targets[i] is not None
            )
            for i, arm in enumerate(ARMS)
        },
        events=events,
        settings=settings,
        machine=_machine(),
    )


def _pairs(ticks: list[Tick], arm: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Actual wrist and target of one arm."""
    return [(tick.wrists[arm], target) for tick in ticks if (target := tick.targets[arm]) is not None]


def _machine() -> dict[str, str]:
    return {
        "platform": platform.platform(),
        "python": platform.python_version(),
        "mujoco": version("mujoco"),
        "ik-service": version("ik-service"),
        "command": " ".join(sys.argv),
    }


def report_table(report: RunReport) -> Table:
    """The report as a table for a terminal."""
    table = Table(title="run", title_justify="left", show_edge=False, pad_edge=False)
    table.add_column("")
    for column in ("p50", "p95", "p99", "max"):
        table.add_column(column, justify="right")
    for arm in ARMS:
        _row(table, f"{arm} wrist off target [mm]", report.wrist_error_mm[arm], 1)
        _row(table, f"{arm} wrist off target [deg]", report.wrist_error_deg[arm], 1)
        _row(table, "  of which the solver left [mm]", report.answer_error_mm[arm], 1)
    _row(table, "solve in the service [us]", report.solve_us, 0)
    _row(table, "solve round trip [ms]", report.round_trip_ms, 2)
    return table


def report_lines(report: RunReport) -> list[str]:
    """The numbers of a report that are not distributions, as sentences."""
    lines = [
        f"{report.seconds:.1f} s simulated at {report.real_time_factor:.3f} x real time"
        f" (could run {report.headroom:.0f} x), {report.late_ticks} of {report.ticks} ticks late",
        f"{report.ticks_without_command} ticks without a command, largest step {report.largest_step:.4f} rad a tick",
        f"{report.tracking_ticks} ticks following, {report.holding_ticks} holding",
    ]
    lines += [f"  held {count} ticks: {reason}" for reason, count in report.hold_reasons.items()]
    others = {status: count for status, count in report.statuses.items() if status != "ok"}
    if others:
        lines.append("answers other than ok: " + ", ".join(f"{count} {status}" for status, count in others.items()))
    return lines


def _row(table: Table, name: str, values: Spread | None, digits: int) -> None:
    cells = ("-",) * 4 if values is None else (values.p50, values.p95, values.p99, values.max)
    table.add_row(escape(name), *(cell if isinstance(cell, str) else f"{cell:.{digits}f}" for cell in cells))
