"""Puts the tables of a saved comparison into a page: `python -m benchmarks.peers.markdown NUMBERS.json PAGE.md`.

They replace whatever is between the page's two marks.
"""

import sys
from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.marked_page import between, fill_page

BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"

HEADS = ("solver", "p50 µs", "p99 µs", "ratio", "success %", "mm p50", "mm p99", "° p99")
PATH_HEADS = ("step p99", "step max", "torn")


def tables(numbers: Mapping[str, Any]) -> str:
    """The tables of all workloads, what was not measured, and what the numbers depend on."""
    machine = numbers["environment"]
    parts = [
        f"Measured {machine['when'][:10]} on {machine['cpu']}, {machine['cores']} cores, Python {machine['python']}; "
        f"load {machine['load']:.1f} at the end. Ratio: time against {numbers['baseline']}."
    ]
    for name, result in numbers["results"].items():
        parts += [f"### {name}, {result['frames']} frames", "\n".join(_table(result["rows"]))]
    if numbers["absent"]:
        missing = "\n".join(f"- {row}: {reason}" for row, reason in numbers["absent"].items())
        parts += ["### Not measured", missing]
    versions = {package: v for row in numbers["rows"].values() for package, v in row["versions"].items()}
    listed = ", ".join(f"{package} {v}" for package, v in sorted({**machine["versions"], **versions}.items()))
    return "\n\n".join([*parts, f"Versions: {listed}."])


def fill(page: str, numbers: Mapping[str, Any]) -> str:
    """The page with the tables between its marks.

    Args:
        page: Text with both marks.
        numbers: A saved comparison.

    Returns:
        The new text.

    Raises:
        ValueError: A mark is missing.
    """
    return between(page, BEGIN, END, lambda: tables(numbers))


def _table(rows: Mapping[str, Any]) -> Iterator[str]:
    paths = all("step_rad" in row for row in rows.values())
    clearances = any("smallest_clearance_mm" in row for row in rows.values())
    heads = [*HEADS, *(PATH_HEADS if paths else ()), "limits", *(["clearance mm"] if clearances else [])]
    yield f"| {' | '.join(heads)} |"
    yield f"| --- |{' ---: |' * (len(heads) - 1)}"
    for name, row in sorted(rows.items(), key=lambda item: item[1]["us"]["p50"]):
        cells = [name, f"{row['us']['p50']:.1f}", f"{row['us']['p99']:.1f}"]
        cells += [f"{row['ratio']:.2f}" if "ratio" in row else "", f"{row['success_percent']:.1f}"]
        cells += [f"{row['position_error_mm'][p]:.3f}" for p in ("p50", "p99")]
        cells.append(f"{row['rotation_error_deg']['p99']:.3f}")
        if paths:
            cells += [f"{row['step_rad'][p]:.3f}" for p in ("p99", "max")] + [str(row["torn_frames"])]
        cells.append(str(row["limit_violations"]))
        if clearances:
            cells.append(f"{row['smallest_clearance_mm']:.1f}")
        yield f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    sys.exit(fill_page(fill))
