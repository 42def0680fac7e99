"""Draws how well arms were followed; runs in the environment of the group `chart` of `benchmarks/peers`.

python chart.py NUMBERS.json CHART.png
"""

import json
import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt

mpl.use("Agg")

COLOURS = {"ours": "#1f6fb4", "webcam": "#d9822b", "thesis": "#8a8a8a"}
PANELS = ("wrist_mean", "wrist_p95", "turn_p95", "turned_over", "jitter", "lag")


def draw(numbers: Path, chart: Path) -> None:
    """Bars of each number with what was asked as a line; below, a wrist beside the true one."""
    document = json.loads(numbers.read_text(encoding="utf-8"))
    dances, names = document["dances"], document["names"]
    figure = plt.figure(figsize=(11.0, 9.0))
    grid = figure.add_gridspec(3, 3, height_ratios=(1.0, 1.0, 0.9))
    for k, number in enumerate(PANELS):
        scale, limit, words, unit = document["asked"][number]
        axis = figure.add_subplot(grid[k // 3, k % 3])
        for n, chain in enumerate(names):
            values = [scale * dance["worst"][chain][number] for dance in dances]
            places = [i + 0.27 * (n - 1) for i in range(len(dances))]
            axis.bar(places, values, 0.26, color=COLOURS[chain], label=names[chain])
        axis.axhline(limit, color="#b02a2a", linewidth=1.0, label="asked at most")
        axis.set_title(f"{words} [{unit}]", fontsize=9)
        labels = [f"{dance['body']}\n{dance['dance']}" for dance in dances]
        axis.set_xticks(range(len(dances)), labels, fontsize=5.5, rotation=30, ha="right", rotation_mode="anchor")
        axis.tick_params(axis="y", labelsize=7)
        if k == 0:
            axis.legend(fontsize=6)
            axis.set_ylim(top=1.35 * axis.get_ylim()[1])
    axis = figure.add_subplot(grid[2, :])
    trace = dances[0]["traces"]
    for chain in ("thesis", "webcam", "ours"):
        axis.plot(trace["t"], trace[chain], color=COLOURS[chain], linewidth=1.0, label=names[chain])
    axis.plot(trace["t"], trace["truth"], "k--", linewidth=0.8, label="truth")
    axis.set_title(f"left wrist before the pelvis, {dances[0]['body']}, {dances[0]['dance']}", fontsize=9)
    axis.set_xlabel("time [s]", fontsize=8)
    axis.set_ylabel("forward [m]", fontsize=8)
    axis.legend(fontsize=6, ncols=4)
    figure.tight_layout()
    figure.savefig(chart, dpi=130)


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
