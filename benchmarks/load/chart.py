"""Draws what the load tests measured; runs in the environment of the group `chart` of `benchmarks/peers`.

python chart.py NUMBERS.json CHART.png
"""

import itertools
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


def bad_clients(report: Numbers) -> Any:
    """Latency of the good clients by percentile, and their p99 round by round."""
    figure, (curve, rounds) = plt.subplots(1, 2, figsize=(10.0, 3.6), layout="constrained")
    half = report["clients"] // 2
    for key, color, label in (("alone", GREY, f"{half} good clients alone"), ("among", BLUE, f"among {half} bad ones")):
        side = report[key]
        found = {float(percent): ms for percent, ms in side["total"]["latency_ms"].items()}
        # The largest of n stands at the share 1/n, so that it has a place on a logarithmic axis.
        share = [1.0 - percent / 100.0 if percent < 100.0 else 1.0 / side["total"]["due"] for percent in found]
        curve.plot(share, list(found.values()), "o-", color=color, markersize=3, label=label)
        p99 = [one["latency_ms"]["99"] for one in side["rounds"]]
        rounds.plot(range(1, len(p99) + 1), p99, "o-", color=color, markersize=3, label=label)
    for axis in (curve, rounds):
        axis.axhline(report["limit_ms"], **ASKED)
        axis.set(yscale="log", ylabel="latency since due [ms]")
        axis.legend(fontsize=7)
    curve.set(xscale="log", xlabel="share of requests that take longer")
    curve.invert_xaxis()
    curve.set_title(f"{report['rate_hz']:g} requests a second each", fontsize=9)
    rounds.set(xlabel="round")
    rounds.set_title("p99, round by round", fontsize=9)
    rounds.set_xticks(range(1, len(report["alone"]["rounds"]) + 1))
    return figure


def soak(report: Numbers) -> Any:
    """Memory, latency, processor time and the generator's own lateness over time."""
    figure, axes = plt.subplots(2, 2, figsize=(10.0, 6.0), sharex=True, layout="constrained")
    (memory, latency), (cpu, late) = axes
    samples, windows = report["samples"], report["windows"]
    t = [one["t_s"] / 60.0 for one in samples]
    for key, color in (("rss_mb", BLUE), ("pss_mb", ORANGE)):
        memory.plot(t, [one[key] for one in samples], color=color, label=key[:3].upper())
    memory.set(ylabel="memory [MB]")
    memory.set_ylim(bottom=0.0)
    memory.set_title("memory of the service", fontsize=9)
    t_windows = [one["t_s"] / 60.0 for one in windows]
    for key, color in (("50", GREY), ("99", BLUE), ("100", ORANGE)):
        label = "max" if key == "100" else f"p{key}"
        latency.plot(t_windows, [one["latency_ms"][key] for one in windows], ".-", color=color, label=label)
    latency.set(yscale="log", ylabel="latency since due [ms]")
    latency.set_title(f"{report['rate_hz']:g} requests a second, windows of {report['window_s']:g} s", fontsize=9)
    steps = list(itertools.pairwise(samples))
    shares = [100.0 * (b["cpu_s"] - a["cpu_s"]) / (b["t_s"] - a["t_s"]) for a, b in steps]
    cpu.plot(t[1:], shares, color=BLUE)
    cpu.set(ylabel="share of a core [%]", xlabel="time [min]")
    cpu.set_ylim(bottom=0.0)
    cpu.set_title("processor time of the service", fontsize=9)
    late.plot(t_windows, [one["lateness_ms"]["99"] for one in windows], ".-", color=GREY, label="p99")
    late.set(ylabel="lateness [ms]", xlabel="time [min]")
    late.set_title("lateness of the generator itself", fontsize=9)
    for axis in (memory, latency, late):
        axis.legend(fontsize=7)
    for axis in axes.flat:
        axis.axvspan(0.0, report["warmup_s"] / 60.0, color=GREY, alpha=0.15, linewidth=0.0)
    return figure


def chaos(report: Numbers) -> Any:
    """Speed of the set-points while things break, and how long each kind of fault takes to be over."""
    figure, (motion, recovery) = plt.subplots(2, 1, figsize=(10.0, 6.0), height_ratios=(3, 2), layout="constrained")
    excerpt = report["excerpt"]
    t, state = excerpt["t_s"], excerpt["state"]
    following = [one == "following" for one in state]
    motion.plot(t, excerpt["speed_rad_s"], color=BLUE, linewidth=1.0)
    top = 1.15 * max(excerpt["speed_rad_s"])
    motion.fill_between(t, 0.0, top, where=following, color=GREY, alpha=0.15, linewidth=0.0, label="following")
    for fault in excerpt["faults"]:
        motion.axvline(fault["t_s"], color=ORANGE, linewidth=1.0)
        motion.text(fault["t_s"], top, f" {fault['what']}", rotation=90, fontsize=6, va="top", ha="right")
    motion.set(xlabel="time [s]", ylabel="fastest joint's set-point [rad/s]", ylim=(0.0, top))
    motion.legend(fontsize=7, loc="upper right")
    motion.set_title(f"beginning of {report['cycles']} faults", fontsize=9)
    names = list(report["recovery_s"])
    for k, name in enumerate(names):
        seconds = report["recovery_s"][name]
        spread = [k + 0.25 * ((7 * j) % 11 / 10.0 - 0.5) for j in range(len(seconds))]
        recovery.plot(seconds, spread, ".", color=BLUE, markersize=4, alpha=0.7)
    recovery.set_yticks(range(len(names)), names)
    recovery.set(xlabel="until the robot follows again [s]", xlim=(0.0, None))
    return figure


KINDS: Mapping[str, Callable[[Numbers], Any]] = {"bad_clients": bad_clients, "soak": soak, "chaos": chaos}


def draw(report: Numbers, path: Path) -> None:
    """Draw the chart of a report."""
    figure = KINDS[report["kind"]](report)
    for axis in figure.axes:
        axis.grid(alpha=0.25)
        axis.set_axisbelow(True)
        axis.tick_params(labelsize=8)
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    draw(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
