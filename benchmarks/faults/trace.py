"""What is known after a run: what the robot's end recorded every control tick, and what was done meanwhile.

All times are those of CLOCK_MONOTONIC, which the processes of one machine share.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.faults.plan import Fault
from ik_proto import Array


@dataclass(frozen=True)
class RobotTrace:
    """The robot's own record; arrays have a row for each control tick.

    Attributes:
        t: When the tick was [s], shape (N,).
        dt: Time the tick counted for [s], shape (N,).
        state: State of the robot's end, shape (N,), of text.
        weight: Weight of the set-point, shape (N,).
        q_set: Set-point, shape (N, n) [rad].
        q: Measured joints, shape (N, n) [rad].
        dq: Measured velocities, shape (N, n) [rad/s].
    """

    t: Array
    dt: Array
    state: np.ndarray
    weight: Array
    q_set: Array
    q: Array
    dq: Array

    @classmethod
    def load(cls, path: Path) -> "RobotTrace":
        """Read a file of `robot_process`."""
        with np.load(path, allow_pickle=False) as saved:
            return cls(**{name: saved[name] for name in cls.__dataclass_fields__})

    @property
    def following(self) -> np.ndarray:
        """Whether commands were followed, shape (N,)."""
        return self.state == "following"

    @property
    def moved(self) -> Array:
        """Largest change of a joint's set-point since the tick before, shape (N,) [rad]; 0 while it has no weight."""
        change = np.abs(np.diff(self.q_set, axis=0, prepend=self.q_set[:1])).max(axis=1)
        ours = self.state != "released"
        return np.where(ours & np.roll(ours, 1), change, 0.0)


@dataclass(frozen=True, slots=True)
class Done:
    """A fault that was brought about.

    Attributes:
        fault: Which.
        t: When [s].
        recovered: When the robot followed again [s]; NaN where it never did.
    """

    fault: Fault
    t: float
    recovered: float


class Diary:
    """What operator processes have written, read as it grows.

    Attributes:
        entries: All lines, oldest first; each has `t`, `pid`, `grip`, `following` and `states`.
    """

    def __init__(self, path: Path) -> None:
        """Read a file, which need not exist yet."""
        self.entries: list[dict[str, Any]] = []
        self._path = path
        self._read = 0

    def update(self) -> None:
        """Read what has been added."""
        if self._path.exists():
            with self._path.open("rb") as file:
                file.seek(self._read)
                whole, newline, _ = file.read().rpartition(b"\n")  # a line may be seen before all of it is there
            self._read += len(whole) + len(newline)
            self.entries += [json.loads(line) for line in whole.splitlines()]


def grips(diary: Sequence[Mapping[str, Any]]) -> list[float]:
    """When an operator gripped who did not before [s]."""
    held: set[int] = set()
    times = []
    for entry in diary:
        if entry["grip"] and entry["pid"] not in held:
            times.append(entry["t"])
        (held.add if entry["grip"] else held.discard)(entry["pid"])
    return times
