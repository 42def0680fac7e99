"""How a command of a client runs: what it lacks, and what goes wrong, is told in one line; Ctrl-C ends it.

Signals are noted and asked for, so the tick that runs is finished, and the arms are braked, before the end.
"""

import signal
import sys
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any

EXIT_OK, EXIT_USAGE = 0, 2

KeepGoing = Callable[[], bool]


def run_command(name: str, extra: str, packages: Sequence[str], command: Callable[[KeepGoing], object]) -> int:
    """Run a command.

    Args:
        name: Its name.
        extra: The extra that has what it needs.
        packages: Import names of that.
        command: Does the work, given what tells whether to go on.

    Returns:
        The exit code: 0 at an end that was asked for, 2 for a mistake, which one line on standard error tells.
    """
    missing = [package for package in packages if find_spec(package) is None]
    if missing:
        return fail(name, f"package {missing[0]} is missing: pip install 'ik-service[{extra}]'")
    from ik_client.errors import IKError

    ended: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _frame: ended.append(number))
    try:
        command(lambda: not ended)
    # The errors of settings, files, devices and addresses are ValueErrors of one line each.
    except (ValueError, IKError, OSError) as error:
        return fail(name, str(error))
    return EXIT_OK


def run_reported(run: Callable[..., Any], settings: object, keep_going: KeepGoing) -> None:
    """Run a session: it says what it has to say, and then its report is told.

    Args:
        run: Takes the settings, what says a line, whether the output is a terminal, and what tells whether to go on;
            gives a report that has `lines`.
        settings: What to run.
        keep_going: Tells whether to go on.
    """
    report = run(settings, say, terminal=sys.stdout.isatty(), keep_going=keep_going)
    for line in report.lines():
        say(line)


def say(line: str) -> None:
    """Tell a person, or a program, a line at once."""
    print(line, flush=True)


def fail(name: str, message: str) -> int:
    """Tell a mistake in one line, and give its exit code."""
    print(f"{name}: {' '.join(message.split())}", file=sys.stderr)
    return EXIT_USAGE
