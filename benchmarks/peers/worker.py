"""The process that measures the solvers of one environment.

It reads one JSON request a line from standard input and answers each with one line on standard output:

- `{"do": "build", "solver": ..., "settings": ...}` -> `{"key": ...}`
- `{"do": "fk", "key": ..., "q": [...]}` -> `{"poses": [[left, right], ...]}`
- `{"do": "run", "key": ..., "workload": ..., "begin": k, "end": n, "q": [...]}` -> `{"q": [...], "us": [...],
  "raised": count}`
- `{"do": "versions", "packages": [...]}` -> `{"versions": {...}}`

A request that fails gets `{"error": "one line"}`. The clock runs around one call of the solver, targets in and joints
out; everything else is outside.

    python -m benchmarks.peers.worker FOLDER
"""

import gc
import importlib
import json
import os
import sys
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from benchmarks.peers.model import Model, Peer

WARM_UP_CALLS, WARM_UP_S = 3, 0.005
"""Least number of calls and time before a block is timed: while the process waited, others used the caches."""


class Worker:
    """Solvers built on request, and the workloads of a folder."""

    def __init__(self, folder: Path) -> None:
        self.model = Model.read(folder)
        self._folder = folder
        self._solvers: list[Peer] = []
        self._workloads: dict[str, dict[str, np.ndarray]] = {}

    def build(self, solver: str, settings: dict[str, Any]) -> dict[str, Any]:
        """Make a solver."""
        module = importlib.import_module(f"benchmarks.peers.solvers.{solver}")
        self._solvers.append(module.build(self.model, settings))
        gc.collect()
        gc.freeze()  # what a library keeps for good is not searched for garbage again and again
        return {"key": len(self._solvers) - 1}

    def fk(self, key: int, q: list[list[float]]) -> dict[str, Any]:
        """Wrist poses of joint positions, by the solver's own kinematics."""
        poses = [[np.asarray(pose).tolist() for pose in self._solvers[key].fk(np.array(row))] for row in q]
        return {"poses": poses}

    def run(self, key: int, workload: str, begin: int, end: int, q: list[float]) -> dict[str, Any]:
        """Solve frames begin to end of a workload, from q or from the starts the workload prescribes."""
        solver, frames = self._solvers[key], self._load(workload)
        lefts, rights, starts = frames["left"], frames["right"], frames.get("starts")
        previous, answers, times, raised = np.array(q), [], [], 0
        gc.collect()
        calls, warm = 0, time.perf_counter() + WARM_UP_S
        while calls < WARM_UP_CALLS or time.perf_counter() < warm:
            self._try(solver, lefts[begin], rights[begin], previous if starts is None else starts[begin])
            calls += 1
        for k in range(begin, end):
            left, right, start = lefts[k], rights[k], (previous if starts is None else starts[k]).copy()
            before = time.perf_counter_ns()
            answer = self._try(solver, left, right, start)
            times.append((time.perf_counter_ns() - before) / 1e3)
            if answer is None or not np.isfinite(answer).all():
                raised += 1
                answer = start
            previous = np.array(answer, dtype=float)
            answers.append(previous.tolist())
        return {"q": answers, "us": times, "raised": raised}

    def versions(self, packages: list[str]) -> dict[str, Any]:
        """Versions of installed packages."""
        return {"versions": {package: _version(package) for package in packages}}

    @staticmethod
    def _try(solver: Peer, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray | None:
        try:
            return solver.solve(left, right, q)
        except (ArithmeticError, RuntimeError, ValueError):  # how peers say that they found nothing
            return None

    def _load(self, name: str) -> dict[str, np.ndarray]:
        if name not in self._workloads:
            with np.load(self._folder / f"{name}.npz") as arrays:
                self._workloads[name] = dict(arrays)
        return self._workloads[name]


def serve(worker: Worker, requests: TextIO, replies: TextIO) -> None:
    """Answer requests until they end."""
    verbs = {"build": worker.build, "fk": worker.fk, "run": worker.run, "versions": worker.versions}
    for line in requests:
        request = json.loads(line)
        verb = verbs[request.pop("do")]
        try:
            reply = verb(**request)
        except Exception as error:  # whatever a peer throws is the driver's to report
            told = str(error).strip().splitlines() or [""]
            reply = {"error": f"{type(error).__name__}: {told[0][:200]}"}
        replies.write(json.dumps(reply) + "\n")
        replies.flush()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def main() -> None:
    """Serve on standard input and output."""
    # Some peers print; that must not get between the replies.
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    serve(Worker(Path(sys.argv[1])), sys.stdin, replies)


if __name__ == "__main__":
    main()
