"""A service as a child process, for the demonstration: started on a free port, killed and restarted on request.

It is reached over the wire like any other. On Linux the child does not outlive this process, however that ends;
elsewhere it is stopped when this process ends in order.
"""

import ctypes
import json
import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import IO, Self

_START_LIMIT = 60.0
"""The first start may compile the solver [s]."""

_STOP_LIMIT = 3.0
_PR_SET_PDEATHSIG = 1


class ServiceFailed(RuntimeError):
    """The service did not start; one line that says why."""


class ServiceProcess:
    """`ik-service serve` on loopback TCP, nothing else.

    Attributes:
        url: Its address for a client; the same after a restart.
    """

    def __init__(self, robot: str, log: Path) -> None:
        """Start it and wait until it serves.

        Args:
            robot: As `--robot`.
            log: Where its log goes; folders are made.

        Raises:
            ServiceFailed: It did not start.
        """
        log.parent.mkdir(parents=True, exist_ok=True)
        self._robot = robot
        self._log_path = log
        self._log: IO[bytes] = log.open("wb")
        self._process = self._spawn("127.0.0.1:0")
        try:
            address = self._ready_line()["tcp"]
        except BaseException:
            self.close()
            raise
        self._address = address
        self.url = f"tcp://{address}"

    def kill(self) -> None:
        """End it at once, as a crash would."""
        self._process.kill()
        self._process.wait()

    def restart(self) -> None:
        """Start it again on the same port, without waiting until it serves."""
        self._close_output()
        self._process = self._spawn(self._address)

    def close(self) -> None:
        """Stop it, in order if it obeys within a few seconds."""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(_STOP_LIMIT)
            except subprocess.TimeoutExpired:
                self.kill()
        self._close_output()
        self._log.close()

    def __enter__(self) -> Self:
        """Use it in a `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop it."""
        self.close()

    def _spawn(self, address: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-P", "-m", "ik_service", "serve", "--robot", self._robot]
        command += ["--tcp", address, "--zenoh", "off", "--http", "off", "--log-format", "json"]
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self._log,
            start_new_session=True,  # Ctrl-C is for this process, which then stops the child.
            preexec_fn=_end_with_parent() if sys.platform == "linux" else None,
        )

    def _ready_line(self) -> dict[str, str]:
        output = self._process.stdout
        assert output is not None
        end = time.monotonic() + _START_LIMIT
        while not select.select([output], [], [], 0.1)[0]:
            if time.monotonic() > end:
                raise ServiceFailed(f"the service did not start within {_START_LIMIT:.0f} s; see {self._log_path}")
        line = output.readline()
        if not line:
            raise ServiceFailed(self._last_words())
        return json.loads(line)

    def _last_words(self) -> str:
        code = self._process.wait()
        lines = self._log_path.read_text(encoding="utf-8", errors="replace").split("\n")
        last = next((line for line in reversed(lines) if line.strip()), f"exit code {code}")
        return f"the service did not start: {last.strip()}"

    def _close_output(self) -> None:
        if self._process.stdout is not None:
            self._process.stdout.close()


def _end_with_parent():
    """What a child runs before its program: ask the kernel to end it when its parent ends."""
    libc = ctypes.CDLL(None)  # Loaded here: a forked child should do as little as possible.
    parent = os.getpid()

    def prepare() -> None:
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # It ended before the request was made.
            os._exit(1)

    return prepare
