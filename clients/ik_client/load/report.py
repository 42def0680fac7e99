"""A load run's result, as a JSON document and as a table. Durations are in seconds in the document."""

import os
import platform
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ik_client.load.outcomes import PERCENTILES, Durations
from ik_client.load.runner import LATENESS_LIMIT, LoadResult

_PACKAGES = ("ik-service", "numpy", "orjson", "msgpack", "eclipse-zenoh", "hdrhistogram")


def load_document(result: LoadResult, command: Sequence[str]) -> dict[str, Any]:
    """Everything there is to say of a run.

    Args:
        result: The run.
        command: The command line that made it.

    Returns:
        A document of plain values.
    """
    outcomes, info, options = result.outcomes, result.info, result.options
    return {
        "tool": "ik-load",
        "command": list(command),
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "options": asdict(options),
        "service": {
            "robot": info.robot,
            "version": info.version,
            "protocol": info.protocol,
            "kernel": info.kernel,
            "preset": options.preset or info.default_preset,
            "model_hash": info.model_hash,
            "boot_id": info.boot_id,
        },
        "machine": {"cpu": _cpu(), "cores": os.cpu_count(), "system": platform.platform()},
        "versions": {"python": platform.python_version()} | {name: version(name) for name in _PACKAGES},
        "interrupted": result.interrupted,
        "measured_s": result.measured,
        "requests": {
            "due": outcomes.total,
            "answered": outcomes.answered,
            "good": outcomes.good,
            "timeouts": outcomes.timeouts,
            "unsent": outcomes.unsent,
            "statuses": dict(outcomes.statuses),
            "errors": dict(outcomes.errors),
        },
        "rates_hz": {
            "asked": options.clients * options.rate if options.rate else None,
            "answered": _rate(outcomes.answered, result.measured),
            "good": _rate(outcomes.good, result.measured),
        },
        "latency_s": outcomes.latency.summary(),
        "round_trip_s": outcomes.round_trip.summary(),
        "solve_s": outcomes.solve.summary(),
        "generator": {
            "lateness_s": outcomes.lateness.summary(),
            "lateness_limit_s": result.lateness_limit,
            "honest": result.honest,
        },
    }


def print_report(result: LoadResult, console: Console) -> None:
    """Print the table.

    Args:
        result: The run.
        console: Where to.
    """
    outcomes, info, options = result.outcomes, result.info, result.options
    pace = f"{options.rate:g} Hz" if options.rate else "as fast as answered"
    kind = "closed loop" if options.closed else "open loop"
    asked = ", ".join(word for word in (options.mode, options.collision and f"collision {options.collision}") if word)
    console.print(
        f"{options.url}: {options.clients} x {pace}, {kind}, {options.workload}, {result.measured:.1f} s; "
        f"{info.robot}, kernel {info.kernel}, preset {options.preset or info.default_preset}, "
        f"{asked and asked + ', '}service {info.version}",
        soft_wrap=True,
    )
    table = Table(caption="ms; latency since due, round trip since sent")
    table.add_column("")
    for percent in PERCENTILES:
        table.add_column(f"p{percent:g}", justify="right")
    table.add_column("max", justify="right")
    table.add_column("count", justify="right")
    for name, durations in (
        ("latency", outcomes.latency),
        ("round trip", outcomes.round_trip),
        ("solve, in service", outcomes.solve),
        ("generator lateness", outcomes.lateness),
    ):
        table.add_row(name, *_milliseconds(durations), str(durations.count))
    console.print(table)
    console.print(
        f"{outcomes.total} requests due: {_counts(outcomes.statuses) or 'none answered'}; "
        f"{outcomes.timeouts} timed out, {outcomes.unsent} never sent, {_counts(outcomes.errors) or 'no other errors'}",
        soft_wrap=True,
    )
    console.print(
        f"{_rate(outcomes.answered, result.measured):.1f} answers/s, "
        f"{_rate(outcomes.good, result.measured):.1f} good ones/s (success within {options.timeout:g} s of when due)",
        soft_wrap=True,
    )
    if not result.honest:
        console.print(
            f"Doubtful: this generator sent late by itself (p99 {outcomes.lateness.percentile(99.0) * 1e3:.2f} ms, "
            f"more than {LATENESS_LIMIT:.0%} of the period). Lower the rate, use fewer clients, or a quieter machine.",
            soft_wrap=True,
        )
    if result.interrupted:
        console.print("Interrupted: these are the numbers up to there.")


def _milliseconds(durations: Durations) -> list[str]:
    if not durations.count:
        return ["-"] * (len(PERCENTILES) + 1)
    return [f"{durations.percentile(percent) * 1e3:.3f}" for percent in (*PERCENTILES, 100.0)]


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))


def _rate(count: int, seconds: float) -> float:
    return count / seconds if seconds > 0.0 else 0.0


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
