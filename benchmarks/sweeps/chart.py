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
    """One panel for the first course of each kind: speed of the hand, and of the fastest joint."""
    shown = json.loads(numbers.read_text(encoding="utf-8"))["traces"]
    figure, axes = plt.subplots(len(shown), 1, figsize=(8.0, 2.2 * len(shown)), sharex=True, squeeze=False)
    for axis, (name, trace) in zip(axes.ravel(), shown.items(), strict=True):
        t, asked, along, _, joint = zip(*trace, strict=True)
        axis.plot(t, asked, "--", color=GREY, linewidth=0.8, label="asked")
        axis.plot(t, along, color=BLUE, label="achieved")
        axis.set_ylabel("hand [m/s]")
        axis.set_title(name, fontsize=9)
        other = axis.twinx()
        other.plot(t, joint, color=ORANGE, linewidth=0.8, label="fastest joint")
        other.set_ylabel("joint [rad/s]")
        other.set_ylim(0.0, 1.7)
    axes[0, 0].legend(fontsize=7, loc="upper right")
    axes[-1, 0].set_xlabel("time [s]")
    figure.tight_layout()
    figure.savefig(chart, dpi=130)


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
