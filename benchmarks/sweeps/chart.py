"""Draws sweeps; runs in the environment of the group `chart` of `benchmarks/peers`.

python chart.py NUMBERS.json CHART.png
"""

import json
import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt

mpl.use("Agg")

BLUE, ORANGE, GREY = "#1f6fb4", "#d9822b", "#8a8a8a"


def draw(numbers: Path, chart: Path) -> None:
    """Squares as they were driven, and for the first course of each kind speed of the hand and of the fastest joint."""
    report = json.loads(numbers.read_text(encoding="utf-8"))
    shown, paths = report["traces"], report["paths"]
    figure = plt.figure(figsize=(10.0, 1.3 * len(shown) + 2.9))
    above, below = figure.subfigures(2, 1, height_ratios=[2.7, 1.3 * len(shown)])
    _draw_squares(above, paths)
    _draw_sweeps(below, shown)
    figure.savefig(chart, dpi=110)


def _draw_squares(figure, paths) -> None:
    axes = figure.subplots(1, len(paths))
    for axis, (name, path) in zip(axes, paths.items(), strict=True):
        up, aside = zip(*path, strict=True)
        axis.plot([1e3 * x for x in aside], [1e3 * y for y in up], color=BLUE, linewidth=1.5, label="driven")
        corners = [(0, 0), (0, 300), (300, 300), (300, 0), (0, 0)]
        axis.plot(*zip(*corners, strict=True), "--", color=ORANGE, linewidth=0.8, label="asked")
        axis.set_title(f"square {name}", fontsize=9)
        axis.set_aspect("equal")
        axis.set_xlabel("[mm]", fontsize=8)
    axes[0].set_ylabel("up [mm]", fontsize=8)
    axes[0].legend(fontsize=7, loc="center")
    figure.subplots_adjust(left=0.07, right=0.97, top=0.9, bottom=0.17)


def _draw_sweeps(figure, shown) -> None:
    axes = figure.subplots(len(shown), 1, sharex=True, squeeze=False)
    for axis, (name, trace) in zip(axes.ravel(), shown.items(), strict=True):
        t, asked, along, _, joint = zip(*trace, strict=True)
        axis.plot(t, asked, "--", color=GREY, linewidth=0.8, label="asked")
        axis.plot(t, along, color=BLUE, label="achieved")
        axis.set_ylabel("hand [m/s]", fontsize=7)
        axis.set_title(name, fontsize=9)
        other = axis.twinx()
        other.plot(t, joint, color=ORANGE, linewidth=0.8, label="fastest joint")
        other.set_ylabel("joint [rad/s]", fontsize=7)
        other.set_ylim(0.0, 1.7)
    axes[0, 0].legend(fontsize=7, loc="upper right")
    axes[-1, 0].set_xlabel("time [s]")
    figure.subplots_adjust(left=0.07, right=0.93, top=0.96, bottom=0.06, hspace=0.55)


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
