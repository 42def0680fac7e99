"""Coverage-guided fuzzing of both decoders: every input is accepted, or refused by a documented error.

    python benchmarks/fuzz_decoders.py [--frames 1000000] [--only NAME,...] [--json FILE]
    python benchmarks/fuzz_decoders.py --live [--rounds 8]

Needs atheris (`pip install atheris`). Inputs begin as the vectors in `proto/` and are changed by their structure and by
their bytes. Requests go through framing, codec, validation, a real solver and back through the client's readers;
replies, through the client's side alone. A frame that breaks the contract is kept in `--folder` and named, and the exit
code is 1.

`--live` asks another question: does somebody else notice? Hostile frames (also those of `--folder`) are thrown at a
service over a socket, and a good client measures its round trips meanwhile, in turns with and without.
"""

import argparse
import json
import os
import shlex
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from benchmarks.environment import environment
from benchmarks.fuzz import live
from benchmarks.fuzz.run import Outcome, fuzz
from benchmarks.fuzz.workbench import TARGETS

PACKAGES = ("ik-service", "atheris", "numpy", "orjson", "msgpack")


def run(names: list[str], options: argparse.Namespace, console: Console) -> dict[str, Outcome]:
    """Fuzz one target after the other."""
    outcomes = {}
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console) as progress:
        for name in names:
            task = progress.add_task(name, total=options.frames)
            outcomes[name] = fuzz(
                name,
                options.frames,
                options.folder / name,
                seed=options.seed,
                kernel=options.kernel,
                tell=lambda frames, task=task: progress.update(task, completed=frames),
            )
    return outcomes


def show(outcomes: dict[str, Outcome], console: Console) -> None:
    """Print what came of it."""
    table = Table(title="Fuzzed frames, by what happened to them", title_justify="left")
    table.add_column("")
    for name in outcomes:
        table.add_column(name, justify="right")
    results = outcomes.values()
    table.add_row("frames", *(f"{result.frames:,}" for result in results))
    table.add_row("frames a second", *(f"{result.rate:,.0f}" for result in results))
    table.add_row("coverage, edges", *(f"{result.edges:,}" for result in results))
    table.add_row("slowest input, ms", *(f"{result.slowest_ms:.1f}" for result in results), end_section=True)
    for kind in sorted({kind for result in results for kind in result.counts}):
        table.add_row(kind, *(f"{result.counts.get(kind, 0):,}" for result in results))
    console.print(table)
    for name, result in outcomes.items():
        if result.fault:
            console.print(f"[bold]{name}: the contract is broken[/bold]; the input: {result.culprit}")
            console.print(result.fault, markup=False, highlight=False)


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=1_000_000, help="of each target (%(default)s)")
    parser.add_argument("--only", metavar="NAME,...", default=",".join(TARGETS), help="targets (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of all choices (%(default)s)")
    parser.add_argument("--kernel", choices=("auto", "vm"), default="auto", help="of the solver (%(default)s)")
    parser.add_argument("--folder", type=Path, help="where corpus, log and culprit are left (a new temporary one)")
    parser.add_argument("--live", action="store_true", help="measure a good client beside a hostile one instead")
    parser.add_argument("--rounds", type=int, default=8, help="of --live: turns with and without (%(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save all numbers")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.only.split(",") if name not in TARGETS]
    if unknown:
        parser.error(f"there is no target {unknown[0]}, there are {', '.join(TARGETS)}")
    options.folder = options.folder or Path(tempfile.mkdtemp(prefix="ik-fuzz-"))
    return options


def main(arguments: list[str] | None = None) -> int:
    """Fuzz, or measure; give the exit code."""
    options = parse(arguments)
    console = Console(width=140)
    if options.live:
        corpus = options.folder / "json-requests" / "corpus"
        result = live.measure(options.rounds, options.seed, corpus if corpus.is_dir() else None)
        live.show(result, console)
        found, good = {"live": result}, True
    else:
        try:
            import atheris  # noqa: F401
        except ImportError:
            console.print("fuzzing needs atheris: pip install atheris")
            return 2
        console.print(f"corpora, logs and whatever breaks: {shlex.quote(str(options.folder))}")
        outcomes = run(options.only.split(","), options, console)
        show(outcomes, console)
        good = not any(outcome.fault for outcome in outcomes.values())
        found = {"fuzz": {name: asdict(outcome) for name, outcome in outcomes.items()}}
    if options.json:
        document = {"environment": environment(PACKAGES), **found}
        options.json.write_text(json.dumps(document, indent=2, default=str) + "\n")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
