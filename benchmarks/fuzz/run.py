"""Runs a fuzzing child to its end and says what came of it."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

REPO = Path(__file__).resolve().parents[2]
_COVERAGE = re.compile(r"^#\d+\s.*\bcov: (\d+)")
_ARTIFACTS = ("crash-*", "timeout-*", "oom-*")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run came to.

    Attributes:
        frames: Bodies that went through.
        seconds: How long that took [s].
        edges: Branches of the instrumented code that were seen.
        slowest_ms: Processor time of the slowest input [ms]; it is kept as `slowest` in the run's folder.
        counts: How often what happened to a body.
        culprit: The input that broke the contract; None where none did.
        fault: What it broke: the end of the child's output. Empty where all was well.
    """

    frames: int
    seconds: float
    edges: int
    slowest_ms: float
    counts: dict[str, int] = field(default_factory=dict)
    culprit: Path | None = None
    fault: str = ""

    @property
    def rate(self) -> float:
        """Frames a second."""
        return self.frames / max(self.seconds, 1e-9)


def fuzz(
    target: str,
    frames: int,
    folder: Path,
    *,
    seed: int = 1,
    kernel: str = "auto",
    tell: Callable[[int], None] | None = None,
    environment: dict[str, str] | None = None,
) -> Outcome:
    """Run a child until enough frames went through it, or one broke the contract.

    Args:
        target: One of `benchmarks.fuzz.workbench.TARGETS`.
        frames: How many.
        folder: Where corpus, log, slowest input and culprit are left.
        seed: Of all choices.
        kernel: "auto" or "vm".
        tell: Hears now and then how many frames went through.
        environment: Additions to the child's environment.

    Returns:
        What came of it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "benchmarks.fuzz.child", "--target", target, "--frames", str(frames)]
    command += ["--seed", str(seed), "--folder", str(folder), "--kernel", kernel]
    last: dict[str, Any] = {"frames": 0, "seconds": 0.0, "slowest_ms": 0.0, "counts": {}}
    said: list[str] = []
    log = folder / "log"
    with (
        log.open("wb") as errors,
        subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            cwd=REPO,
            env={**os.environ, "OMP_NUM_THREADS": "1", **(environment or {})},
        ) as child,
    ):
        assert child.stdout is not None
        for line in child.stdout:
            if line.startswith("{"):
                last = json.loads(line)
                if tell is not None:
                    tell(last["frames"])
            else:  # atheris tells of an uncaught exception here
                said.append(line)
    edges, complaints = _read_log(log)
    outcome = {name: last[name] for name in ("frames", "seconds", "slowest_ms", "counts")}
    if child.returncode == 0:
        return Outcome(edges=edges, **outcome)
    culprit = next((file for pattern in _ARTIFACTS for file in folder.glob(pattern)), None)
    fault = "".join(said).strip() or complaints or f"the child ended with {child.returncode}"
    return Outcome(edges=edges, culprit=culprit, fault=fault[-4000:], **outcome)


def _read_log(log: Path) -> tuple[int, str]:
    """Coverage, and what is in libFuzzer's log besides its own chatter."""
    edges, rest = 0, []
    for line in log.read_text(errors="replace").splitlines():
        if found := _COVERAGE.match(line):
            edges = int(found[1])
        elif not line.startswith(("#", "INFO:", "WARNING:")):
            rest.append(line)
    return edges, "\n".join(rest).strip()
