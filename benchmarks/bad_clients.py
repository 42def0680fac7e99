"""Do clients that misbehave slow down those that do not?

    python benchmarks/bad_clients.py [--clients 64] [--rounds 5] [--json FILE] [--chart FILE]

Half of the clients are robots: 50 requests a second each, due at fixed times, with latency counted from then. The other
half are slow readers, slow writers, senders of junk and floods in equal parts (benchmarks/load/villains.py). A real
service is loaded by the good ones alone and by all, in turns, so that both see the same machine. The service has a core
for itself where there are two or more; the good ones are a process and the bad ones another, which gives way to it.

Exit code 1: the p99 of the good ones among the bad is 10 ms or more, or one of their requests got no answer.
"""

import argparse
import contextlib
import os
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import sys

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.load.fleet import Fleet, tracking_frames
from benchmarks.load.proc import sample
from benchmarks.load.processes import Service, child, cores, first_line, service
from benchmarks.load.results import Verdict, at_most, judge, save, verdict_documents
from benchmarks.load.villains import KINDS
from ik_client import IKClient, IKError
from ik_client.load.generator import Schedule
from ik_client.load.outcomes import Durations, Outcomes

P99_LIMIT_MS = 10.0
LATENESS_LIMIT = 0.1
"""Share of the period that the generator's own p99 lateness may take before its numbers are in doubt, as `ik-load`."""

WARMUP_S = 0.5
PERCENTS = (50.0, 75.0, 90.0, 95.0, 98.0, 99.0, 99.5, 99.8, 99.9, 99.95, 100.0)
SHOWN = (50.0, 90.0, 99.0, 99.9, 100.0)
PACKAGES = ("ik-service", "uvloop", "numpy", "orjson")
NICENESS = 10
SETTLE_LIMIT_S, CALM_S, CALM_ANSWERS = 30.0, 0.01, 20
"""How long the service may take to come to rest between rounds [s]: so many answers in a row within that time."""


@dataclass
class Side:
    """The good clients' outcomes, alone or among bad ones.

    Attributes:
        rounds: What came of each round.
        cpu: Share of a core each process took, by round.
        counts: What the bad ones did, by kind, summed over the rounds.
    """

    rounds: list[Outcomes] = field(default_factory=list)
    cpu: list[dict[str, float]] = field(default_factory=list)
    counts: dict[str, dict[str, int]] = field(default_factory=dict)

    @property
    def total(self) -> Outcomes:
        """All rounds together."""
        total = Outcomes()
        for outcomes in self.rounds:
            total.add(outcomes)
        return total

    def note(self, counts: dict[str, dict[str, int]]) -> None:
        """Add what the bad ones did in a round."""
        for kind, numbers in counts.items():
            mine = self.counts.setdefault(kind, {})
            for name, count in numbers.items():
                mine[name] = mine.get(name, 0) + count


def one_round(
    target: Service,
    frames: list[bytes],
    clients: int,
    rate: float,
    seconds: float,
    side: Side,
    bad_each: int,
    tell: Callable[[float], None],
) -> None:
    """Load the service once; the outcome goes to the side."""
    with ExitStack() as stack:
        pids = {"service": target.pid, "good clients": os.getpid()}
        villains = None
        if bad_each:
            arguments = ["-m", "benchmarks.load.villains", target.host, str(target.port), "--each", str(bad_each)]
            villains = stack.enter_context(child(arguments, cores()[1]))
            os.setpriority(os.PRIO_PROCESS, villains.pid, NICENESS)
            first_line(villains, "the process of bad clients")
            pids["bad clients"] = villains.pid
        fleet = Fleet((target.host, target.port), frames, clients)
        stack.callback(fleet.close)
        before, begin = {name: sample(pid).cpu_s for name, pid in pids.items()}, time.monotonic() + 0.05
        schedule = Schedule(begin, begin + WARMUP_S, begin + WARMUP_S + seconds, 1.0 / rate, grace=1.0)
        (outcomes,) = fleet.run(schedule, tell)
        passed = time.monotonic() - begin
        side.rounds.append(outcomes)
        side.cpu.append({name: (sample(pid).cpu_s - before[name]) / passed for name, pid in pids.items()})
        if villains is not None:
            assert villains.stdin is not None
            villains.stdin.close()
            side.note(json.loads(first_line(villains, "the process of bad clients")))


def settle(target: Service) -> None:
    """Wait until the service has done with what clients left behind, so that it counts for nobody else.

    Raises:
        SystemExit: It has not within half a minute.
    """
    end = time.monotonic() + SETTLE_LIMIT_S
    with IKClient(target.url, timeout=1.0, connect_timeout=SETTLE_LIMIT_S) as ik:
        calm = 0
        while calm < CALM_ANSWERS:
            if time.monotonic() > end:
                raise SystemExit(f"the service did not come to rest within {SETTLE_LIMIT_S:.0f} s")
            asked = time.monotonic()
            with contextlib.suppress(IKError):
                ik.info()
            calm = calm + 1 if time.monotonic() - asked < CALM_S else 0


def measure(clients: int, rate: float, rounds: int, seconds: float, progress: Progress) -> tuple[Side, Side, str]:
    """Load a service in turns; give both sides and the kernel that solved."""
    good, bad_each = clients // 2, clients // 2 // len(KINDS)
    alone, among = Side(), Side()
    task = progress.add_task("loading", total=2 * rounds * (WARMUP_S + seconds))
    with service() as target:
        frames = tracking_frames(target.url, rate, count=500)
        done = 0.0
        for _ in range(rounds):
            for side, each in ((alone, 0), (among, bad_each)):

                def tell(passed: float, done: float = done) -> None:
                    progress.update(task, completed=done + passed, refresh=True)

                settle(target)
                one_round(target, frames, good, rate, seconds, side, each, tell)
                done += WARMUP_S + seconds
        return alone, among, target.ready["kernel"]


def table(alone: Side, among: Side, clients: int, rate: float) -> Table:
    """Both sides beside each other."""
    good = clients // 2
    out = Table(title=f"{good} good clients at {rate:g} Hz; ms since a request was due", title_justify="left")
    out.add_column("")
    for percent in SHOWN:
        out.add_column("max" if percent == 100.0 else f"p{percent:g}", justify="right")
    for name in ("p99 late", "due", "unanswered", "service", "good", "bad"):
        out.add_column(name, justify="right")
    for name, side in (("alone", alone), (f"among {good} bad ones", among)):
        total = side.total
        shares = [
            f"{100 * sum(cpu.get(process, 0.0) for cpu in side.cpu) / len(side.cpu):.0f} %"
            for process in ("service", "good clients", "bad clients")
        ]
        late = f"{1e3 * total.lateness.percentile(99.0):.2f}"
        row = [f"{1e3 * total.latency.percentile(percent):.2f}" for percent in SHOWN]
        out.add_row(name, *row, late, str(total.total), str(total.failed), *shares)
    out.caption = "late: the generator itself; service, good, bad: share of a core"
    return out


def deeds(among: Side) -> Table:
    """What the bad ones did."""
    names = ("connections", "closed by the service", "bytes sent", "bytes received")
    out = Table(title="What the bad ones did", title_justify="left")
    for name in ("", *names):
        out.add_column(name, justify="right" if name else "left")
    for kind, counts in among.counts.items():
        out.add_row(kind, *(f"{counts.get(name, 0):,}" for name in names))
    return out


def verdicts(among: Side) -> list[Verdict]:
    """What was asked for."""
    total = among.total
    p99 = 1e3 * total.latency.percentile(99.0) if total.latency.count else float("nan")
    return [
        at_most("p99 of good clients among bad ones", p99, P99_LIMIT_MS, "ms"),
        at_most("requests of good clients without an answer", total.failed, 0),
    ]


def document(side: Side) -> dict[str, Any]:
    """A side, JSON-ready."""
    return {
        "total": _numbers(side.total),
        "rounds": [_numbers(outcomes) for outcomes in side.rounds],
        "cpu": side.cpu,
        "bad_clients": side.counts,
    }


def _numbers(outcomes: Outcomes) -> dict[str, Any]:
    return {
        "due": outcomes.total,
        "failed": outcomes.failed,
        "statuses": dict(outcomes.statuses),
        "errors": dict(outcomes.errors) | {"timeouts": outcomes.timeouts, "unsent": outcomes.unsent},
        "latency_ms": _percentiles(outcomes.latency),
        "lateness_ms": _percentiles(outcomes.lateness),
        "solve_ms": _percentiles(outcomes.solve),
    }


def _percentiles(durations: Durations) -> dict[str, float]:
    return {f"{percent:g}": round(1e3 * durations.percentile(percent), 4) for percent in PERCENTS}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the test."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clients", type=int, default=64, metavar="N", help="good and bad ones together (64)")
    parser.add_argument("--rate", type=float, default=50.0, metavar="HZ", help="requests a second of a good one (50)")
    parser.add_argument("--rounds", type=int, default=5, metavar="N", help="turns of each side (5)")
    parser.add_argument("--seconds", type=float, default=5.0, metavar="S", help="length of a turn (5)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers")
    parser.add_argument("--chart", type=Path, metavar="FILE", help="draw the latencies, PNG or SVG")
    options = parser.parse_args(arguments)
    if options.clients < 2 * len(KINDS):
        parser.error(f"--clients: half of them must be {len(KINDS)} or more, one of each kind")
    if min(options.rate, options.rounds, options.seconds) <= 0:
        parser.error("--rate, --rounds and --seconds must be positive")
    console = Console(width=max(Console().width, 130))
    # Drawn only when the fleet says so: a thread that draws would compete with it.
    with Progress(console=console, transient=True, auto_refresh=False) as progress:
        alone, among, kernel = measure(options.clients, options.rate, options.rounds, options.seconds, progress)
    console.print(table(alone, among, options.clients, options.rate))
    console.print(deeds(among))
    lateness, limit = among.total.lateness.percentile(99.0), LATENESS_LIMIT / options.rate
    if lateness > limit:
        console.print(
            f"Doubtful: the generator sent late by itself (p99 {lateness * 1e3:.2f} ms); use a quieter machine."
        )
    found = verdicts(among)
    report = {
        "kind": "bad_clients",
        "environment": environment(PACKAGES),
        "kernel": kernel,
        "clients": options.clients,
        "rate_hz": options.rate,
        "limit_ms": P99_LIMIT_MS,
        "honest": lateness <= limit,
        "alone": document(alone),
        "among": document(among),
        "verdicts": verdict_documents(found),
    }
    save(report, options.json, options.chart, console)
    return judge(found, console)


if __name__ == "__main__":
    sys.exit(main())
