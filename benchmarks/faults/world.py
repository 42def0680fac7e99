"""Service, robot and operator as three processes, and the faults that befall them while the robot moves."""

import ctypes
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from benchmarks.faults.audit import disarms
from benchmarks.faults.plan import Fault, Kind, Victim
from benchmarks.faults.trace import Diary, Done, RobotTrace, grips
from ik_client import ArmState

START_LIMIT_S, STOP_LIMIT_S = 60.0, 15.0
RECOVERY_LIMIT_S = 30.0
"""How long the robot may take to follow again after a fault [s]. Generous: machines are slow at times."""

STEADY_S = 0.2
"""How long the robot must have followed to count as following again [s]."""

_POLL_S = 0.01
_PR_SET_PDEATHSIG = 1


class Lost(Exception):
    """The run cannot go on; one line that says why."""


class Process:
    """A Python program that can be started again.

    Attributes:
        faults: Exit codes that were not as they should be, a line each.
    """

    def __init__(self, name: str, command: Callable[[], list[str]], log: Path) -> None:
        """Prepare; nothing runs yet.

        Args:
            name: What it is called in messages.
            command: Gives the arguments of the interpreter.
            log: Where its standard error goes.
        """
        self.faults: list[str] = []
        self._name = name
        self._command = command
        self._log = log
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it, without waiting for anything."""
        libc, parent = ctypes.CDLL(None), os.getpid()

        def end_with_parent() -> None:
            libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
            if os.getppid() != parent:
                os._exit(1)

        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, *self._command()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log,
                preexec_fn=end_with_parent,
                env={**os.environ, "OMP_NUM_THREADS": "1"},
            )

    def ready_line(self) -> dict[str, Any]:
        """The first line it prints, a JSON document.

        Raises:
            Lost: There is none in time.
        """
        assert self._process is not None
        assert self._process.stdout is not None
        if not select.select([self._process.stdout], [], [], START_LIMIT_S)[0]:
            raise Lost(f"the {self._name} was not ready within {START_LIMIT_S:.0f} s; see {self._log}")
        line = self._process.stdout.readline()
        if not line:
            raise Lost(f"the {self._name} ended with {self._process.wait()} instead of becoming ready; see {self._log}")
        return json.loads(line)

    def send(self, number: signal.Signals) -> None:
        """Send a signal."""
        assert self._process is not None
        self._process.send_signal(number)

    def wait(self, expected: int) -> None:
        """Wait for its end, and note an exit code other than the one expected."""
        assert self._process is not None
        assert self._process.stdout is not None
        try:
            code = self._process.wait(STOP_LIMIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            code = None
        self._process.stdout.close()
        self._process = None
        if code is None:
            self.faults.append(f"the {self._name} did not end within {STOP_LIMIT_S:.0f} s of its signal")
        elif code != expected:
            self.faults.append(f"the {self._name} ended with {code}, not {expected}")

    def check(self) -> None:
        """Raise where it has ended by itself."""
        if self._process is not None and (code := self._process.poll()) is not None:
            raise Lost(f"the {self._name} ended by itself with {code}; see {self._log}")

    def close(self) -> None:
        """End it, whatever state it is in."""
        if self._process is not None:
            assert self._process.stdout is not None
            self._process.kill()
            self._process.wait()
            self._process.stdout.close()
            self._process = None


class World:
    """The three processes.

    Attributes:
        diary: What the operators write down.
    """

    def __init__(self, folder: Path) -> None:
        """Start all of them; logs, diary and trace go to the folder.

        Args:
            folder: An existing folder.

        Raises:
            Lost: One of them does not start.
        """
        self._folder = folder
        self._trace = folder / "trace.npz"
        self.diary = Diary(folder / "diary.jsonl")
        tcp, front_ends = "127.0.0.1:0", ("--zenoh", "off", "--http", "off", "--log-format", "json")

        def serve() -> list[str]:
            return ["-m", "ik_service", "serve", "--tcp", tcp, *front_ends]

        def robot() -> list[str]:
            record = ["-m", "benchmarks.faults.robot_process", str(self._trace)]
            return [*record, "--listen", "127.0.0.1:0", "--headless", "--report", str(folder / "report.json")]

        self._robot = Process("robot", robot, folder / "robot.log")
        self._service = Process("service", serve, folder / "service.log")
        with ExitStack() as stack:
            for process in (self._robot, self._service):
                process.start()
                stack.callback(process.close)
            tcp = self._service.ready_line()["tcp"]
            robot_address = self._robot.ready_line()["listen"]
            module = "benchmarks.faults.operator_process"
            operate = ["-m", module, f"tcp://{tcp}", f"tcp://{robot_address}", str(folder / "diary.jsonl")]
            self._operator = Process("operator", lambda: operate, folder / "operator.log")
            self._operator.start()
            stack.callback(self._operator.close)
            self._close = stack.pop_all().close
        self._processes = {Victim.SERVICE: self._service, Victim.OPERATOR: self._operator}

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all processes."""
        self._close()

    def run(self, faults: Iterable[Fault], tell: Callable[[int], None] = lambda _: None) -> list[Done]:
        """Bring the faults about, one after the other, each while the robot moves.

        Args:
            faults: The faults.
            tell: Called with how many are over.

        Returns:
            What was done; where the robot does not follow again, the last of it says so.

        Raises:
            Lost: A process that nothing was done to has ended, or the robot does not follow although nothing was done.
        """
        done: list[Done] = []
        for fault in faults:
            if self._follows_for(fault.after, time.monotonic()) is None:
                raise Lost(f"the robot does not follow although nothing was done to it; see {self._folder}")
            begin = time.monotonic()
            self._bring_about(fault)
            followed = self._follows_for(STEADY_S, begin, regripped=disarms(fault))
            done.append(Done(fault, begin, float("nan") if followed is None else followed))
            tell(len(done))
            if followed is None:
                break
        return done

    def end(self) -> tuple[RobotTrace, list[str]]:
        """Stop all in order.

        Returns:
            The robot's record, and exit codes that were not as they should be.
        """
        for process in (self._operator, self._robot, self._service):
            process.send(signal.SIGTERM)
            process.wait(0)
        self.diary.update()
        faults = [line for process in (self._robot, self._operator, self._service) for line in process.faults]
        return RobotTrace.load(self._trace), faults

    def _bring_about(self, fault: Fault) -> None:
        """Do it, and put things right again."""
        victim = self._processes[fault.victim]
        match fault.kind:
            case Kind.STOP:
                victim.send(signal.SIGSTOP)
                try:
                    time.sleep(fault.lasts)  # the duration is the fault, not a wait for something
                finally:
                    victim.send(signal.SIGCONT)
                return
            case Kind.KILL:
                victim.send(signal.SIGKILL)
                victim.wait(-signal.SIGKILL)
            case Kind.TERM:
                victim.send(signal.SIGTERM)
                victim.wait(0)
        victim.start()

    def _follows_for(self, seconds: float, after: float, regripped: bool = False) -> float | None:
        """Wait until both arms have followed for so long, from now on.

        Args:
            seconds: How long [s].
            after: Where a new grip is waited for, it must be later than this [s].
            regripped: Whether to wait for a new grip.

        Returns:
            When that began [s]; None where it does not come to that in time.
        """
        asked = time.monotonic()
        while time.monotonic() - asked < RECOVERY_LIMIT_S:
            for process in (self._robot, *self._processes.values()):
                process.check()
            self.diary.update()
            entries = self.diary.entries
            since = None
            for entry in reversed(entries):
                if not _active(entry) or entry["t"] <= asked:
                    break
                since = entry["t"]
            gripped = not regripped or grips(entries)[-1:] > [after]
            if gripped and since is not None and entries[-1]["t"] - since >= seconds:
                return since
            time.sleep(_POLL_S)
        return None


def _active(entry: Mapping[str, Any]) -> bool:
    """Whether the robot follows, and does not merely hold, when a line of the diary is written."""
    return entry["following"] and all(state == ArmState.ACTIVE for state in entry["states"])
