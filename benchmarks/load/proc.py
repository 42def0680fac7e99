"""What Linux tells of a process: memory, threads, descriptors, processor time."""

import os
from dataclasses import dataclass
from pathlib import Path

_TICKS = os.sysconf("SC_CLK_TCK")
_UTIME, _STIME, _THREADS = 11, 12, 17
"""Places in /proc/PID/stat behind the name of the program, see proc(5)."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A look at a process.

    Attributes:
        rss_mb: Resident memory [MB, 10^6 bytes].
        pss_mb: The same, with pages that processes share divided among them [MB].
        threads: Number of threads.
        descriptors: Number of open file descriptors.
        cpu_s: Processor time used since it began [s].
    """

    rss_mb: float
    pss_mb: float
    threads: int
    descriptors: int
    cpu_s: float


def sample(pid: int) -> Sample:
    """Look at a process of the same user.

    Args:
        pid: Its number.

    Returns:
        What it uses.

    Raises:
        OSError: It is gone.
    """
    folder = Path("/proc") / str(pid)
    memory = dict(line.split(":", 1) for line in (folder / "smaps_rollup").read_text(encoding="utf-8").splitlines()[1:])
    stat = (folder / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return Sample(
        rss_mb=_megabytes(memory["Rss"]),
        pss_mb=_megabytes(memory["Pss"]),
        threads=int(stat[_THREADS]),
        descriptors=len(os.listdir(folder / "fd")),
        cpu_s=(int(stat[_UTIME]) + int(stat[_STIME])) / _TICKS,
    )


def _megabytes(text: str) -> float:
    """`1234 kB`, where the kernel means 1024 bytes."""
    return int(text.split()[0]) * 1024e-6
