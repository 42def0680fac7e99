"""The command `ik-load`."""

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from ik_client.access_options import AccessFiles, add_access_options
from ik_client.address import FORMS, parse_address
from ik_client.errors import IKError
from ik_proto import COLLISIONS, MODES

OK, SOME_FAILED, UNUSABLE, INTERRUPTED = 0, 1, 2, 130

_WORKLOADS = ("tracking", "random", "unreachable")

_DESCRIPTION = """\
Put a service under load and measure how fast and how reliably it answers.

Open loop: each client's requests are due at a constant rate, fixed beforehand, and latency counts from when a request
was due. So a service that freezes for a moment is charged for everything it kept waiting. With --closed a client waits
for its answer first, as a simple benchmark would; compare the two to see what that hides.
"""

_EPILOG = """\
workloads:
  tracking      smooth two-arm motion, each solve starting from the solution before it
  random        unrelated reachable targets from unrelated joints: cold starts
  unreachable   targets at 1.3 times the reach of the arms

examples:
  ik-load tcp://127.0.0.1:12345 --rate 50 --duration 10               one robot
  ik-load zenoh://127.0.0.1:7447 --rate 100 --clients 8               eight robots over Zenoh
  ik-load tcp://127.0.0.1:12345 --closed --workload random            back to back: the most one client can get
  ik-load tcp://127.0.0.1:12345 --workload random --mode reach        global solves from unrelated joints
  ik-load tcp://127.0.0.1:12345 --rate 200 --json load.json           keep all numbers
  ik-load tls://robot:12345 --ca ca.pem --token-file ik.token         a service on another machine

exit status:
  0  every request was answered
  1  some were not: timed out, failed or never sent
  2  wrong arguments, no service there, or a package missing
  130  interrupted before anything was sent
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Command line without the program's name; the process's own where not given.

    Returns:
        The exit status.
    """
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.rate is None and not options.closed:
        options.rate = 50.0
    try:
        parse_address(options.url)
        _check_writable(options.json)
    except ValueError as error:
        return _fail(str(error))
    try:
        from rich.console import Console

        from ik_client.load.progress import ProgressBar
        from ik_client.load.report import load_document, print_report
        from ik_client.load.runner import LoadOptions, run_load
    except ModuleNotFoundError as error:
        return _fail(
            f"the package {error.name} is missing; install what this needs with: pip install 'ik-service[load]'"
        )
    try:
        with ProgressBar(Console(stderr=True)) as progress:
            result = run_load(
                LoadOptions(
                    url=options.url,
                    rate=options.rate,
                    duration=options.duration,
                    clients=options.clients,
                    closed=options.closed,
                    workload=options.workload,
                    seed=options.seed,
                    timeout=options.timeout,
                    warmup=options.warmup,
                    preset=options.preset,
                    mode=options.mode,
                    collision=options.collision,
                    access=AccessFiles.taken_from(vars(options)),
                ),
                progress,
            )
    except (IKError, ValueError) as error:
        return _fail(str(error))
    except KeyboardInterrupt:
        print("ik-load: interrupted before anything was sent", file=sys.stderr)
        return INTERRUPTED
    print_report(result, Console())
    if options.json is not None:
        document = load_document(result, ["ik-load", *(sys.argv[1:] if arguments is None else arguments)])
        options.json.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    return SOME_FAILED if result.outcomes.failed else OK


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ik-load",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("url", metavar="URL", help=FORMS)
    add("--rate", type=_positive(float), metavar="HZ", help="requests per second of each client [50; --closed: none]")
    add("--duration", type=_positive(float), default=10.0, metavar="S", help="how long requests count [10]")
    add("--clients", type=_positive(int), default=1, metavar="N", help="clients at once, a connection each [1]")
    add("--closed", action="store_true", help="a client's next request waits for the answer to the one before")
    add("--workload", choices=_WORKLOADS, default="tracking", help="what to ask for [tracking]")
    add("--preset", metavar="NAME", help="cost to minimise [the service's default]")
    add("--mode", choices=MODES, help="stay near the joints a solve starts from, or search their whole range [track]")
    add("--collision", choices=COLLISIONS, help="what to do about self-collision [the service's default]")
    add("--seed", type=int, default=0, metavar="N", help="decides all that is random in the workload [0]")
    add("--timeout", type=_positive(float), default=1.0, metavar="S", help="how long a request may take [1]")
    add("--warmup", type=_at_least_zero, default=0.5, metavar="S", help="how long to send before counting [0.5]")
    add("--json", type=Path, metavar="FILE", help="write all numbers, versions and the command line there")
    add_access_options(parser)
    add("--version", action="version", version=f"ik-load {version('ik-service')}")
    return parser


def _positive(kind: Callable[[str], float]) -> Callable[[str], float]:
    def read(text: str) -> float:
        value = _number(kind, text)
        if not (value > 0 and math.isfinite(value)):
            raise argparse.ArgumentTypeError(f"{text} is not positive")
        return value

    return read


def _at_least_zero(text: str) -> float:
    value = _number(float, text)
    if not (value >= 0.0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return value


def _number(kind: Callable[[str], float], text: str) -> float:
    try:
        return kind(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text} is no {'whole ' if kind is int else ''}number") from None


def _check_writable(file: Path | None) -> None:
    """Find out before the run, not after it, that its file cannot be written."""
    if file is None:
        return
    if file.is_dir():
        raise ValueError(f"{file} is a folder; name a file in it")
    if not os.access(file if file.exists() else file.parent, os.W_OK):
        raise ValueError(f"{file} cannot be written; choose an existing folder of yours")


def _fail(message: str) -> int:
    print(f"ik-load: {message}", file=sys.stderr)
    return UNUSABLE
