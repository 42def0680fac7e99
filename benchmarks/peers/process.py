"""The driver's end of a worker: one process, one request at a time."""

import json
import os
import select
import subprocess
from pathlib import Path
from typing import IO, Any

REPO = Path(__file__).resolve().parents[2]
LIMIT_S = 600.0
"""Longest wait for a reply: JAX compiles on the first call."""

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class WorkerError(Exception):
    """A request that failed, or a worker that is gone; the message is one line."""


class WorkerProcess:
    """A running `benchmarks.peers.worker`."""

    def __init__(self, python: Path, folder: Path, log: Path) -> None:
        """Start it.

        Args:
            python: Interpreter of its environment.
            folder: Folder with model and workloads.
            log: File for whatever the peer prints.
        """
        variables = {**os.environ, **ONE_THREAD, "PYTHONPATH": str(REPO)}
        with log.open("wb") as errors:
            self._process = subprocess.Popen(
                [python, "-m", "benchmarks.peers.worker", folder],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                env=variables,
                cwd=REPO,
                text=True,
            )

    def ask(self, do: str, **fields: Any) -> dict[str, Any]:
        """Send a request and wait for its reply.

        Args:
            do: The verb.
            **fields: Its arguments.

        Returns:
            The reply.

        Raises:
            WorkerError: The request failed, or the process ended or fell silent.
        """
        requests, replies = self._pipes()
        try:
            requests.write(json.dumps({"do": do, **fields}) + "\n")
            requests.flush()
        except BrokenPipeError:
            raise WorkerError(self._ended()) from None
        if not select.select([replies], [], [], LIMIT_S)[0]:
            self._process.kill()
            raise WorkerError(f"no reply within {LIMIT_S:.0f} s")
        line = replies.readline()
        if not line:
            raise WorkerError(self._ended())
        reply = json.loads(line)
        if "error" in reply:
            raise WorkerError(reply["error"])
        return reply

    def close(self) -> None:
        """Let it end."""
        requests, replies = self._pipes()
        try:
            requests.close()
            self._process.wait(10.0)
        except (BrokenPipeError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        replies.close()

    def _pipes(self) -> tuple[IO[str], IO[str]]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        return self._process.stdin, self._process.stdout

    def _ended(self) -> str:
        code = self._process.wait(10.0)
        return f"its process ended with signal {-code}" if code < 0 else f"its process ended with code {code}"
