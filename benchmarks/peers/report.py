"""Tables of a comparison."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

COLUMNS = (
    "p50 µs",
    "p95",
    "p99",
    "ratio",
    "success",
    "mm p50",
    "p99",
    "deg p50",
    "p99",
    "step p99",
    "max",
    "torn",
    "limits",
    "clearance",
)


def table(name: str, result: Mapping[str, Any], baseline: str) -> Table:
    """One workload's table, the quickest row first.

    Args:
        name: The workload.
        result: Its part of the report: frames, and a summary a row.
        baseline: The row whose time is the unit of the ratio.

    Returns:
        The table.
    """
    title = f"{name}: {result['frames']} frames; ratio: time against {baseline}; steps in rad, clearance in mm"
    out = Table(title=title, title_justify="left")
    out.add_column("solver", no_wrap=True)
    for column in COLUMNS:
        out.add_column(column, justify="right")
    for row, numbers in sorted(result["rows"].items(), key=lambda item: item[1]["us"]["p50"]):
        out.add_row(row, *_cells(numbers))
    return out


def absent_table(absent: Mapping[str, str]) -> Table:
    """Rows that were not measured, and why."""
    out = Table(title="not measured", title_justify="left")
    out.add_column("solver", no_wrap=True)
    out.add_column("why")
    for row, reason in absent.items():
        out.add_row(row, reason)
    return out


def _cells(numbers: Mapping[str, Any]) -> list[str]:
    steps, clearance = numbers.get("step_rad"), numbers.get("smallest_clearance_mm")
    cells = [f"{numbers['us'][p]:.1f}" for p in ("p50", "p95", "p99")]
    cells.append(f"{numbers['ratio']:.2f}x" if "ratio" in numbers else "")
    cells.append(f"{numbers['success_percent']:.1f} %")
    cells += [f"{numbers['position_error_mm'][p]:.3f}" for p in ("p50", "p99")]
    cells += [f"{numbers['rotation_error_deg'][p]:.3f}" for p in ("p50", "p99")]
    cells += [f"{steps[p]:.3f}" for p in ("p99", "max")] if steps else ["", ""]
    cells.append(str(numbers["torn_frames"]) if steps else "")
    cells.append(str(numbers["limit_violations"]))
    cells.append("" if clearance is None else f"{clearance:.1f}")
    return cells
