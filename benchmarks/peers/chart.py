"""Draws the chart of a saved comparison; runs in the environment of the group `chart`.

python chart.py NUMBERS.json CHART.png
"""

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt

mpl.use("Agg")

COLORS = {"ours": "#1f6fb4", "reference": "#8a8a8a"}
PEER_COLOR = "#d9a441"
CHATTER_RAD = 0.3


def bars(axis: Any, names: list[str], values: list[float | None], colors: list[str]) -> None:
    """Horizontal bars from the top down; a row without a value stays empty."""
    for place, (value, color) in enumerate(zip(values, colors, strict=True)):
        if value is not None:
            axis.barh(place, value, color=color, height=0.7)
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.4, -0.6)
    axis.grid(axis="x", alpha=0.25)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def label(axis: Any, place: int, value: float, text: str) -> None:
    """Write beside the end of a bar."""
    axis.annotate(text, (value, place), (3, 0), textcoords="offset points", va="center", fontsize=7)


def _time(us: float) -> str:
    return f"{us:.1f} µs" if us < 100.0 else f"{us:,.0f} µs"


def draw(numbers: dict[str, Any], path: Path) -> None:
    """Time on a path, time and success from an unrelated start, and steps beyond reach, one row a solver."""
    results = {name: result["rows"] for name, result in numbers["results"].items()}
    tracking, cold, beyond = (results.get(name, {}) for name in ("tracking", "cold", "unreachable"))
    names = sorted(tracking, key=lambda name: tracking[name]["us"]["p50"])
    colors = [COLORS.get(numbers["rows"][name]["peer"], PEER_COLOR) for name in names]
    figure, axes = plt.subplots(1, 3, figsize=(13, 0.29 * len(names) + 1.3), sharey=True, layout="constrained")

    for axis, rows, title in (
        (axes[0], tracking, "tracking: time a frame, both arms [µs]"),
        (axes[1], cold, "cold start: time a solve, both arms [µs]"),
    ):
        bars(axis, names, [rows[name]["us"]["p50"] if name in rows else None for name in names], colors)
        for place, name in enumerate(names):
            if name in rows:
                row = rows[name]
                text = f"{_time(row['us']['p50'])}, {row['success_percent']:.3g} %"
                label(axis, place, row["us"]["p50"], text)
        axis.set_xscale("log")
        axis.set_title(f"{title}\nmedian; share within 1 mm and 1°", fontsize=9)
        axis.margins(x=0.45)

    steps = [beyond[name]["step_rad"]["p99"] if name in beyond else None for name in names]
    bars(axes[2], names, steps, colors)
    for place, value in enumerate(steps):
        if value is not None:
            error = beyond[names[place]]["position_error_mm"]["p50"]
            label(axes[2], place, value, f"{value:.2g}, {error:.0f} mm off")
    axes[2].axvline(CHATTER_RAD, color="#b03030", linewidth=0.8, linestyle="--")
    axes[2].set_title(
        "unreachable: joint step a frame [rad]\n99th percentile, beyond the line: chatter; median distance", fontsize=9
    )
    axes[2].margins(x=0.35)
    for axis in axes:
        axis.tick_params(labelsize=8)
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    draw(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
