"""Draws what `benchmarks/gamepad.py` measured; runs in the environment of the group `chart` of `benchmarks/peers`.

python chart.py NUMBERS.json CHART.png
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt

mpl.use("Agg")


def draw(report: Mapping[str, Any], path: Path) -> None:
    """Draw the share of pushes that were answered within a time, a line for each rate."""
    figure, axis = plt.subplots(figsize=(6.0, 3.4), layout="constrained")
    for turn in report["turns"]:
        latencies = sorted(turn["latencies_ms"])
        shares = [(k + 1) / len(latencies) for k in range(len(latencies))]
        axis.step(latencies, shares, where="post", label=f"{turn['rate']:g} Hz")
    axis.axvline(report["asked_ms"], color="#c23b3b", linewidth=1.2, label="asked of the median")
    axis.axhline(0.5, color="#8a8a8a", linewidth=0.8)
    axis.set(xlabel="from a stick to the command that leaves [ms]", ylabel="share of pushes", ylim=(0.0, 1.0))
    axis.set_xlim(left=0.0)
    axis.grid(alpha=0.25)
    axis.legend(fontsize=8)
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    draw(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
