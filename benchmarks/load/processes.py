"""The processes of a load test, each where it disturbs the others least.

With two cores or more the service has the last one for itself, and whatever loads it shares the others.
"""

import json
import os
import select
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

_START_LIMIT_S, _STOP_LIMIT_S = 60.0, 10.0


@dataclass(frozen=True)
class Service:
    """A running service.

    Attributes:
        pid: Its process.
        host: Where it listens.
        port: The port.
        ready: Its ready line.
    """

    pid: int
    host: str
    port: int
    ready: dict[str, Any]

    @property
    def url(self) -> str:
        """Its address for a client."""
        return f"tcp://{self.host}:{self.port}"


def cores() -> tuple[set[int], set[int]]:
    """Cores of the service, and of what loads it."""
    available = sorted(os.sched_getaffinity(0))
    return ({available[-1]}, set(available[:-1])) if len(available) > 1 else (set(available), set(available))


@contextmanager
def service(*arguments: str) -> Generator[Service]:
    """Run `ik-service serve` on a free loopback port, TCP only.

    Args:
        arguments: More options of `ik-service serve`.

    Yields:
        The service, once it serves.

    Raises:
        SystemExit: It does not start.
    """
    command = ("-m", "ik_service", "serve", "--tcp", "127.0.0.1:0", "--zenoh", "off", "--http", "off")
    of_service, of_load = cores()
    with child([*command, "--log-format", "json", *arguments], of_service) as process:
        ready = json.loads(first_line(process, "the service"))
        os.sched_setaffinity(0, of_load)
        host, _, port = ready["tcp"].rpartition(":")
        yield Service(process.pid, host, int(port), ready)


@contextmanager
def child(arguments: list[str], on: set[int]) -> Generator[subprocess.Popen[str]]:
    """Run a Python program on some cores; it is stopped at the end."""
    mine = os.sched_getaffinity(0)
    os.sched_setaffinity(0, on)  # a process starts with the cores of its parent
    try:
        process = subprocess.Popen(
            [sys.executable, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )
    finally:
        os.sched_setaffinity(0, mine)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(_STOP_LIMIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        for pipe in (process.stdin, process.stdout):
            assert pipe is not None
            pipe.close()
        os.sched_setaffinity(0, mine)


def first_line(process: subprocess.Popen[str], what: str) -> str:
    """The first line a child prints.

    Raises:
        SystemExit: It prints none in time.
    """
    assert process.stdout is not None
    if not select.select([process.stdout], [], [], _START_LIMIT_S)[0]:
        raise SystemExit(f"{what} did not start within {_START_LIMIT_S:.0f} s")
    line = process.stdout.readline()
    if not line:
        raise SystemExit(f"{what} ended with exit code {process.wait()} instead of starting")
    return line
