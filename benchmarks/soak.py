"""Does a service that runs for long grow or slow down?

    python benchmarks/soak.py [--minutes 10] [--rate 1000] [--json FILE] [--chart FILE]

A real service solves a thousand requests a second of twenty clients, due at fixed times, with latency counted from
then. Meanwhile its memory, descriptors, threads and processor time are looked at, and latencies summed up by windows.

Exit code 1: after the warm-up its resident memory grew by more than 5 MB, it holds more descriptors or threads, a
request got no answer, or the p99 of the windows rises beyond noise. That means: the 95 % confidence interval of the
slope lies above zero (benchmarks/load/drift.py), and the rise over the run exceeds the spread between windows.
"""

import argparse
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.load.drift import Drift, drift
from benchmarks.load.fleet import Fleet, tracking_frames
from benchmarks.load.proc import Sample, sample
from benchmarks.load.processes import service
from benchmarks.load.results import Verdict, at_most, judge, save, verdict_documents
from ik_client.load.generator import Schedule
from ik_client.load.outcomes import Durations, Outcomes

GROWTH_LIMIT_MB = 5.0
CLIENTS = 20
LOOK_S = 5.0
"""How often the service is looked at [s]; adding up its memory takes the kernel about a millisecond."""

LEAST_WINDOWS, LONGEST_WINDOW_S = 10, 10.0
WARMUP_SHARE, LONGEST_WARMUP_S = 0.1, 60.0
PERCENTS = (50.0, 90.0, 99.0, 99.9, 100.0)
PACKAGES = ("ik-service", "uvloop", "numpy", "orjson", "casadi", "pin")


@dataclass(frozen=True)
class Soak:
    """What was found.

    Attributes:
        kernel: What solved.
        rate: Requests a second that were due.
        warmup: Time before anything counts [s].
        window: Length of a window [s].
        times: When the service was looked at, from the beginning [s].
        samples: What it used then.
        windows: What came of the requests.
    """

    kernel: str
    rate: float
    warmup: float
    window: float
    times: list[float]
    samples: list[Sample]
    windows: list[Outcomes]

    @property
    def warm(self) -> list[Sample]:
        """The samples after the warm-up."""
        return [one for t, one in zip(self.times, self.samples, strict=True) if t >= self.warmup]

    @property
    def middles(self) -> np.ndarray:
        """Middles of the windows, from the beginning [s]."""
        return self.warmup + self.window * (0.5 + np.arange(len(self.windows)))

    @property
    def total(self) -> Outcomes:
        """All windows together."""
        total = Outcomes()
        for outcomes in self.windows:
            total.add(outcomes)
        return total

    def drift(self) -> Drift:
        """How the p99 of the windows changes [ms]."""
        return drift(self.middles, np.array([1e3 * one.latency.percentile(99.0) for one in self.windows]))


def run(seconds: float, rate: float, progress: Progress) -> Soak:
    """Load a service and look at it."""
    warmup = min(WARMUP_SHARE * seconds, LONGEST_WARMUP_S)
    window = min(LONGEST_WINDOW_S, (seconds - warmup) / LEAST_WINDOWS)
    look = min(LOOK_S, seconds / (4 * LEAST_WINDOWS))
    with service() as target:
        frames = tracking_frames(target.url, rate / CLIENTS, count=1000)
        task = progress.add_task("soaking", total=seconds, note="")
        times, samples = [0.0], [sample(target.pid)]
        begin = time.monotonic() + 0.05

        def tell(passed: float) -> None:
            times.append(passed)
            samples.append(sample(target.pid))
            progress.update(task, completed=passed, note=f"{samples[-1].rss_mb:.1f} MB", refresh=True)

        fleet = Fleet((target.host, target.port), frames, CLIENTS, window=window)
        try:
            schedule = Schedule(begin, begin + warmup, begin + seconds, CLIENTS / rate, grace=1.0)
            windows = fleet.run(schedule, tell, every=look)
            tell(time.monotonic() - begin)
        finally:
            fleet.close()
        return Soak(target.ready["kernel"], rate, warmup, window, times, samples, windows)


def verdicts(soak: Soak) -> list[Verdict]:
    """What was asked for."""
    first, *later = soak.warm
    trend = soak.drift()
    return [
        at_most("growth of resident memory", max(one.rss_mb for one in later) - first.rss_mb, GROWTH_LIMIT_MB, "MB"),
        at_most("more descriptors at the end", later[-1].descriptors - first.descriptors, 0),
        at_most("more threads at the end", later[-1].threads - first.threads, 0),
        at_most("requests without an answer", soak.total.failed, 0),
        Verdict(
            "p99 from begin to end",
            f"{trend.change:+.3f} ms, 95 % sure of {_span(soak, trend)} ms",
            f"rise of no more than {trend.noise:.3f} ms, the spread between windows, or not sure",
            not trend.beyond_noise,
        ),
    ]


def _span(soak: Soak, trend: Drift) -> str:
    length = float(np.ptp(soak.middles))
    return f"{trend.low * length:+.3f} to {trend.high * length:+.3f}"


def table(soak: Soak) -> Table:
    """Tenths of the run beside each other."""
    out = Table(title=f"{soak.rate:g} requests a second, {soak.times[-1] / 60:.1f} min, kernel {soak.kernel}")
    out.title_justify = "left"
    for name in (
        "from",
        "RSS [MB]",
        "PSS [MB]",
        "fds",
        "threads",
        "p50",
        "p99",
        "p99.9",
        "max [ms]",
        "p99 late",
        "due",
    ):
        out.add_column(name, justify="right")
    for part in np.array_split(np.arange(len(soak.windows)), min(10, len(soak.windows))):
        begin = soak.warmup + soak.window * float(part[0])
        k = int(np.searchsorted(soak.times[:-1], begin))
        used, outcomes = soak.samples[k], Outcomes()
        for index in part:
            outcomes.add(soak.windows[index])
        out.add_row(
            f"{begin:.0f} s",
            f"{used.rss_mb:.2f}",
            f"{used.pss_mb:.2f}",
            str(used.descriptors),
            str(used.threads),
            *(f"{1e3 * outcomes.latency.percentile(percent):.2f}" for percent in (50.0, 99.0, 99.9, 100.0)),
            f"{1e3 * outcomes.lateness.percentile(99.0):.2f}",
            str(outcomes.total),
        )
    return out


def document(soak: Soak, found: Sequence[Verdict]) -> dict[str, Any]:
    """All of it, JSON-ready."""
    return {
        "kind": "soak",
        "environment": environment(PACKAGES),
        "kernel": soak.kernel,
        "rate_hz": soak.rate,
        "clients": CLIENTS,
        "warmup_s": soak.warmup,
        "window_s": soak.window,
        "samples": [{"t_s": t, **asdict(one)} for t, one in zip(soak.times, soak.samples, strict=True)],
        "windows": [
            {
                "t_s": float(t),
                "due": one.total,
                "failed": one.failed,
                "latency_ms": _percentiles(one.latency),
                "lateness_ms": _percentiles(one.lateness),
            }
            for t, one in zip(soak.middles, soak.windows, strict=True)
        ],
        "p99_drift_ms_per_s": asdict(soak.drift()),
        "verdicts": verdict_documents(found),
    }


def _percentiles(durations: Durations) -> dict[str, float]:
    return {f"{percent:g}": round(1e3 * durations.percentile(percent), 4) for percent in PERCENTS}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the soak."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, metavar="MIN", help="how long (10)")
    parser.add_argument("--seconds", type=float, metavar="S", help="the same in seconds, for a first look")
    parser.add_argument(
        "--rate", type=float, default=1000.0, metavar="HZ", help="requests a second of all clients (1000)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers")
    parser.add_argument("--chart", type=Path, metavar="FILE", help="draw memory and latency over time, PNG or SVG")
    options = parser.parse_args(arguments)
    seconds = 60.0 * options.minutes if options.seconds is None else options.seconds
    if min(seconds, options.rate) <= 0.0:
        parser.error("--minutes, --seconds and --rate must be positive")
    console = Console(width=max(Console().width, 120))
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(), TextColumn("{task.fields[note]}"))
    # Drawn only when the fleet says so: a thread that draws would compete with it.
    with Progress(*columns, console=console, transient=True, auto_refresh=False) as progress:
        soak = run(seconds, options.rate, progress)
    console.print(table(soak))
    lateness = soak.total.lateness.percentile(99.0)
    if lateness > 0.1 * CLIENTS / options.rate:
        console.print(
            f"Doubtful: the generator sent late by itself (p99 {lateness * 1e3:.2f} ms); use a quieter machine."
        )
    found = verdicts(soak)
    save(document(soak, found), options.json, options.chart, console)
    return judge(found, console)


if __name__ == "__main__":
    sys.exit(main())
