"""Draws how cost grows; runs in the environment of the group `chart` of `benchmarks/peers`.

python chart.py NUMBERS.json CHART.png
"""

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt

mpl.use("Agg")

BLUE, ORANGE, GREY = "#1f6fb4", "#d9822b", "#8a8a8a"
ASKED = {"color": GREY, "linewidth": 0.8, "linestyle": "--"}

Numbers = Mapping[str, Any]


def budgets(axis: Any, numbers: Numbers) -> None:
    """Success and time of a reach against the starts it may try."""
    points = [(int(budget), found) for budget, found in numbers["budgets"].items()]
    x = [budget for budget, _ in points]
    misses = [100.0 - found["success_percent"] for _, found in points]
    targets = points[0][1]["targets"]
    least = 10.0 / targets  # a tenth of one miss stands for none: zero has no place on a logarithmic axis
    axis.plot(x, [max(miss, least) for miss in misses], "o-", color=BLUE)
    axis.set(xscale="log", yscale="log", xlabel="starts at most", ylabel="targets missed [%]")
    axis.set_title(f"reach: misses against starts, {targets} targets", fontsize=9)
    axis.margins(y=0.12)
    for budget, miss in zip(x, misses, strict=True):
        axis.annotate(f"{miss:.3g}", (budget, max(miss, least)), (4, 5), textcoords="offset points", fontsize=7)
    times = axis.twinx()
    for key, color in (("p50", ORANGE), ("p99", GREY)):
        times.plot(x, [found["us"][key] for _, found in points], ".--", color=color, label=f"time {key}")
    times.set(yscale="log", ylabel="time, both arms [µs]")
    times.legend(fontsize=7, loc="center right")
    _ticks(axis, x)


def winners(axis: Any, numbers: Numbers) -> None:
    """Which start reached the target."""
    won = {int(start): count for start, count in numbers["won_by"].items()}
    axis.bar(list(won), list(won.values()), color=BLUE)
    axis.set(yscale="log", xlabel="start that won; 0 is the request's q", ylabel="targets")
    axis.set_title(f"reach: which start wins, {numbers['targets']} targets", fontsize=9)


def batches(axis: Any, numbers: Numbers) -> None:
    """Solves a second against batch size."""
    sizes: list[int] = []
    for name, style in (("clear", "-"), ("tracking", ":")):
        for setting, color in (("off", BLUE), ("avoid", ORANGE)):
            rates = {int(size): rate for size, rate in numbers[name][setting].items() if size != "loop"}
            sizes = list(rates)
            axis.plot(sizes, list(rates.values()), f"o{style}", color=color, markersize=3, label=f"{name}, {setting}")
    for asked in (100e3, 40e3):
        axis.axhline(asked, **ASKED)
    axis.set(xscale="log", yscale="log", xlabel="batch size", ylabel="solves a second")
    axis.set_title("solve_batch, all cores", fontsize=9)
    axis.legend(fontsize=7)
    _ticks(axis, sizes)


def pairs(axis: Any, numbers: Numbers) -> None:
    """Time of a call against checked pairs."""
    for setting, color in (("report", BLUE), ("avoid", ORANGE)):
        times = {int(count): us for count, us in numbers["us_p50"][setting].items()}
        axis.plot(list(times), list(times.values()), "o-", color=color, label=setting)
    axis.margins(y=0.3)
    axis.set(xlabel="pairs of capsules checked", ylabel="time p50, both arms [µs]")
    axis.set_ylim(bottom=0.0)
    axis.set_title("tracking a clear path: time against pairs", fontsize=9)
    axis.legend(fontsize=7)


PANELS: tuple[tuple[str, Callable[[Any, Numbers], None]], ...] = (
    ("reach", budgets),
    ("reach", winners),
    ("batch", batches),
    ("pairs", pairs),
)


def draw(report: Numbers, path: Path) -> None:
    """One panel for each thing that was measured."""
    found = [(panel, report["results"][name]["numbers"]) for name, panel in PANELS if name in report["results"]]
    if not found:
        raise SystemExit("nothing measured that has a chart: reach, batch or pairs")
    rows = -(-len(found) // 2)
    figure, axes = plt.subplots(rows, 2, figsize=(10.0, 3.4 * rows), squeeze=False, layout="constrained")
    for axis in axes.flat[len(found) :]:
        axis.remove()
    for axis, (panel, numbers) in zip(axes.flat, found, strict=False):
        panel(axis, numbers)
        axis.grid(alpha=0.25)
        axis.set_axisbelow(True)
        axis.tick_params(labelsize=8)
    figure.savefig(path, dpi=130)


def _ticks(axis: Any, values: list[int]) -> None:
    axis.set_xticks(values, [str(value) for value in values])
    axis.minorticks_off()


if __name__ == "__main__":
    draw(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
