"""Draws what `benchmarks/xr.py` measured; runs in the environment of the group `chart` of `benchmarks/peers`.

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

COLORS = {"on": "#1f6fb4", "album": "#4aa564", "stalled": "#d9822b", "off": "#8a8a8a"}
ASKED = {"color": "#c23b3b", "linewidth": 1.2}
PERCENTILES = ("p50", "p95", "p99")


def draw(report: Mapping[str, Any], path: Path) -> None:
    """Draw each stage's percentiles, the modes beside each other, and where the wrists came to rest."""
    figure, (latency, wrists) = plt.subplots(1, 2, figsize=(10.0, 3.8), width_ratios=(3, 1), layout="constrained")
    stages, modes, turns = report["stages"], report["modes"], report["turns"]
    for row, stage in enumerate(stages):
        for k, mode in enumerate(modes):
            found = [turn["report"]["stages_ms"].get(stage) for turn in turns if turn["mode"] == mode]
            found = [one for one in found if one]
            if not found:
                continue
            y = row + 0.2 * (k - 0.5 * (len(modes) - 1))
            low, middle, high = (sorted(one[p] for one in found)[len(found) // 2] for p in PERCENTILES)
            latency.plot([low, high], [y, y], color=COLORS[mode], linewidth=2.0)
            latency.plot([low], [y], "o", color=COLORS[mode], markersize=5, label=modes[mode] if row == 1 else None)
            latency.plot([middle, high], [y, y], "|", color=COLORS[mode], markersize=9)
    for stage, limit in (("video", "video_ms"), ("command", "command_ms")):
        row = list(stages).index(stage)
        latency.plot([report["limits"][limit]] * 2, [row - 0.42, row + 0.42], **ASKED)
    latency.set_yticks(range(len(stages)), [f"{name}\n{words}" for name, words in stages.items()], fontsize=8)
    latency.invert_yaxis()
    latency.set(xscale="log", xlabel="latency [ms]: p50, p95, p99; red: asked of p50")
    latency.legend(fontsize=7)
    latency.set_title(f"hands that move for {report['seconds']:g} s at 60 poses a second", fontsize=9)
    for k, turn in enumerate(turns):
        wrists.plot([k, k], turn["wrist_mm"], "o", color=COLORS[turn["mode"]], markersize=5)
    wrists.axhline(report["limits"]["wrist_mm"], **ASKED)
    wrists.set(xlabel="turn", ylabel="wrist from its target [mm]")
    wrists.set_ylim(bottom=0.0)
    wrists.set_xticks(range(len(turns)), [str(k + 1) for k in range(len(turns))])
    wrists.set_title("1 s after the hands stopped", fontsize=9)
    for axis in figure.axes:
        axis.grid(alpha=0.25)
        axis.set_axisbelow(True)
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    draw(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
