"""One load run: ask the service for the workload, connect the clients, send, collect.

Each client has a thread and an `IKClient` of its own. Threads of one process, because they measured as punctual as
processes up to 16 clients at 100 Hz; where that does not hold, the run says so itself (`LoadResult.honest`).
"""

import contextlib
import ctypes
import math
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Protocol

from ik_client.access_options import AccessFiles
from ik_client.client import IKClient
from ik_client.load.generator import Generator, Schedule
from ik_client.load.outcomes import Outcomes
from ik_client.load.workloads import MOST_FRAMES, Workload, make_workload
from ik_proto import Collision, InfoReply, Mode

LATENESS_LIMIT = 0.1
"""Share of the period that the generator's own p99 lateness may take before its numbers are in doubt."""

_PREPARE_SECONDS = 5.0
"""How long a call may take while nothing is measured yet [s]."""

_CLOSED_FRAME_RATE = 50.0
"""Frame rate of a path in a closed loop without a rate [Hz]."""
_START_DELAY = 0.05
_POLL = 0.1


@dataclass(frozen=True, slots=True)
class LoadOptions:
    """What to run.

    Attributes:
        url: The service's address.
        rate: Requests per second of each client [Hz]; None, in a closed loop only, for as fast as answers come.
        duration: How long requests count [s].
        clients: How many clients at once.
        closed: Whether each client waits for its answer before its next request is due.
        workload: Name of the workload.
        seed: Decides all that is random in it.
        timeout: How long a request may take [s].
        warmup: How long requests are sent before they count [s].
        preset: Cost to minimise; None for the service's default.
        mode: How to solve; None for the protocol's default.
        collision: What to do about self-collision; None for the service's default.
        access: Where the credentials are that the service asks for.
    """

    url: str
    rate: float | None
    duration: float
    clients: int = 1
    closed: bool = False
    workload: str = "tracking"
    seed: int = 0
    timeout: float = 1.0
    warmup: float = 0.5
    preset: str | None = None
    mode: Mode | None = None
    collision: Collision | None = None
    access: AccessFiles = field(default_factory=AccessFiles)

    @property
    def period(self) -> float:
        """Time from one request of a client to its next [s]; 0 where answers set the pace."""
        return 1.0 / self.rate if self.rate else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class LoadResult:
    """What came of a run.

    Attributes:
        options: What was run.
        info: Who answered.
        outcomes: Of all clients together.
        measured: How long requests counted [s].
        interrupted: Whether it was ended early.
    """

    options: LoadOptions
    info: InfoReply
    outcomes: Outcomes
    measured: float
    interrupted: bool

    @property
    def lateness_limit(self) -> float | None:
        """Own lateness at the 99th percentile beyond which the numbers are in doubt [s]; None without a rate."""
        return LATENESS_LIMIT * self.options.period if self.options.rate else None

    @property
    def honest(self) -> bool:
        """Whether the generator kept its own schedule."""
        return self.lateness_limit is None or self.outcomes.lateness.percentile(99.0) <= self.lateness_limit


class Progress(Protocol):
    """Is told how a run goes on."""

    def stage(self, name: str, total: float) -> None:
        """Begin a stage of so many steps or seconds."""
        ...

    def advance(self, done: float, note: str = "") -> None:
        """So much of the stage is done."""
        ...


def run_load(options: LoadOptions, progress: Progress) -> LoadResult:
    """Run a load.

    Args:
        options: What to run.
        progress: Is told how it goes on.

    Returns:
        What came of it; Ctrl-C ends the sending early and gives what there is.

    Raises:
        IKError: The service cannot be reached, does not let us in, or does not give the workload.
        ValueError: A credential cannot be read.
        KeyboardInterrupt: Ctrl-C before anything was sent.
    """
    access = options.access.arguments()
    with IKClient(options.url, timeout=max(options.timeout, _PREPARE_SECONDS), **access) as ik:
        info = ik.info()
        workload = _prepare(options, ik, progress)
    with contextlib.ExitStack() as stack:
        clients = [
            stack.enter_context(IKClient(options.url, timeout=options.timeout, preset=options.preset, **access))
            for _ in range(options.clients)
        ]
        return _send(options, info, workload, clients, progress)


def _prepare(options: LoadOptions, ik: IKClient, progress: Progress) -> Workload:
    rate = options.rate or _CLOSED_FRAME_RATE
    frames = min(MOST_FRAMES, math.ceil(rate * (options.warmup + options.duration)))
    progress.stage("asking for targets", frames)
    done = 0

    def one() -> None:
        nonlocal done
        done += 1
        progress.advance(done)

    return make_workload(options.workload, ik, seed=options.seed, rate=rate, frames=frames, progress=one)


def _send(
    options: LoadOptions, info: InfoReply, workload: Workload, clients: list[IKClient], progress: Progress
) -> LoadResult:
    _sharpen_timers()
    stop = threading.Event()
    begin = time.monotonic() + _START_DELAY
    measure, end = begin + options.warmup, begin + options.warmup + options.duration
    generators = [
        Generator(
            ik,
            workload,
            Schedule(
                # Clients take turns within a period, and begin at different places of the path.
                begin=begin + k * options.period / len(clients),
                measure=measure,
                end=end,
                period=options.period,
                closed=options.closed,
                grace=options.timeout,
                first=k * len(workload.q) // len(clients),
            ),
            good_within=options.timeout,
            mode=options.mode,
            collision=options.collision,
            stopped=stop.is_set,
        )
        for k, ik in enumerate(clients)
    ]
    progress.stage("sending", options.warmup + options.duration)
    with ThreadPoolExecutor(len(generators)) as pool:
        running = [pool.submit(generator.run) for generator in generators]
        try:
            while not all(future.done() for future in running):
                time.sleep(_POLL)
                count = sum(generator.outcomes.latency.count for generator in generators)
                progress.advance(time.monotonic() - begin, f"{count} requests")
        except KeyboardInterrupt:
            stop.set()
        stopped = min(time.monotonic(), end)
        total = Outcomes()
        for future in running:
            total.add(future.result())
    return LoadResult(options, info, total, max(stopped - measure, 0.0), stop.is_set())


def _sharpen_timers() -> None:
    """Ask Linux to end sleeps of this and later threads within 1 us instead of 50 us of their time."""
    set_timer_slack, nanoseconds = 29, 1000
    with contextlib.suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).prctl(set_timer_slack, nanoseconds, 0, 0, 0)
