"""Measures rows side by side: one worker process an environment, and the rows take turns.

A turn is a block of frames of one workload. All rows solve block k before anyone solves block k + 1, and who goes first
rotates, so that whatever else the machine does falls on all alike. Only one process works at a time. Each row starts a
frame from its own previous answer, or from the start that the workload prescribes.
"""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers import describe
from benchmarks.peers.environments import Unavailable, prepare
from benchmarks.peers.process import WorkerError, WorkerProcess
from benchmarks.peers.roster import Row
from benchmarks.workloads import Workload
from ik_proto.robots import RobotDescription
from ik_service.robot import Robot

BLOCK = 50
"""Frames a row solves in one turn."""

FK_POSTURES = 20
FK_AGREEMENT = 1e-6
"""Largest difference of a peer's wrist poses from ours: entries of 4x4 matrices [1, m]."""

Suite = Mapping[str, Sequence[Workload]]
"""Workloads by the name of what they show; a name can have several, such as the clips of recorded motion."""


@dataclass
class Run:
    """What a row did on one name of the suite.

    Attributes:
        answers: Joint positions, one array of shape (N, nq) a workload [rad].
        times: Times of the calls, one list a block [us].
        raised: Calls that ended in an error or gave something that is not a number.
    """

    answers: list[np.ndarray] = field(default_factory=list)
    times: list[list[float]] = field(default_factory=list)
    raised: int = 0


@dataclass
class Contestant:
    """A row that can be measured.

    Attributes:
        row: The row.
        versions: Versions of its packages.
        fk_difference: Largest difference of its wrist poses from ours.
        runs: What it did, by name of the suite.
    """

    row: Row
    versions: Mapping[str, str]
    fk_difference: float
    worker: WorkerProcess
    keys: Mapping[str, int]
    runs: dict[str, Run] = field(default_factory=dict)


@dataclass(frozen=True)
class Comparison:
    """All that was measured.

    Attributes:
        contestants: Rows that were measured to the end.
        absent: Names of the rows that were not, and why.
    """

    contestants: list[Contestant]
    absent: dict[str, str]


def compare(
    description: RobotDescription,
    robot: Robot,
    suite: Suite,
    rows: Sequence[Row],
    folder: Path,
    tell: Callable[[str, int], None],
) -> Comparison:
    """Measure rows on a suite.

    Args:
        description: The robot's description.
        robot: The robot built from it.
        suite: The workloads.
        rows: Who takes part.
        folder: Existing empty folder for models, workloads and logs.
        tell: Called with what is going on and the number of frames just solved.

    Returns:
        What came out; a row that cannot be measured is named with the reason.
    """
    describe.write(folder, description, robot)
    for workload in (workload for group in suite.values() for workload in group):
        arrays: dict[str, Any] = {"left": workload.left, "right": workload.right}
        if workload.starts is not None:
            arrays["starts"] = workload.starts
        np.savez(folder / f"{workload.name}.npz", **arrays)
    absent: dict[str, str] = {}
    with ExitStack() as stack:
        contestants = list(_gather(rows, robot, suite, folder, absent, stack, tell))
        for name, group in suite.items():
            for workload in group:
                _measure(name, workload, contestants, absent, tell)
    return Comparison([one for one in contestants if one.row.name not in absent], absent)


def _gather(
    rows: Sequence[Row],
    robot: Robot,
    suite: Suite,
    folder: Path,
    absent: dict[str, str],
    stack: ExitStack,
    tell: Callable[[str, int], None],
) -> Iterable[Contestant]:
    workers: dict[str, WorkerProcess | str] = {}
    for row in rows:
        tell(f"preparing {row.name}", 0)
        if row.group not in workers:
            workers[row.group] = _start(row.group, folder, stack)
        worker = workers[row.group]
        if isinstance(worker, str):
            absent[row.name] = worker
            continue
        try:
            yield _enter(row, robot, suite, worker)
        except WorkerError as error:
            absent[row.name] = str(error)


def _start(group: str, folder: Path, stack: ExitStack) -> WorkerProcess | str:
    """Start the worker of an environment, or say why that is impossible."""
    try:
        python = prepare(group) if group else Path(sys.executable)
    except Unavailable as error:
        return str(error)
    worker = WorkerProcess(python, folder, folder / f"{group or 'ours'}.log")
    stack.callback(worker.close)
    return worker


def _enter(row: Row, robot: Robot, suite: Suite, worker: WorkerProcess) -> Contestant:
    """Build a row's solvers and hold its kinematics against ours."""
    built: list[tuple[dict[str, Any], int]] = []
    keys = {}
    for name in suite:
        settings = row.settings_on(name)
        if settings is None:
            continue
        key = next((key for other, key in built if other == settings), None)
        if key is None:
            key = worker.ask("build", solver=row.solver, settings=settings)["key"]
            built.append((settings, key))
        keys[name] = key
    difference = max((_fk_difference(worker, key, robot) for _, key in built), default=0.0)
    if not difference <= FK_AGREEMENT:
        raise WorkerError(f"its forward kinematics differs from ours by {difference:.2g}")
    return Contestant(row, worker.ask("versions", packages=row.packages)["versions"], difference, worker, keys)


def _fk_difference(worker: WorkerProcess, key: int, robot: Robot) -> float:
    postures = np.random.default_rng(0).uniform(robot.lower, robot.upper, (FK_POSTURES, robot.nq))
    theirs = np.array(worker.ask("fk", key=key, q=postures.tolist())["poses"])
    return float(np.abs(theirs - np.array([robot.fk(q) for q in postures])).max())


def _measure(
    name: str,
    workload: Workload,
    contestants: Sequence[Contestant],
    absent: dict[str, str],
    tell: Callable[[str, int], None],
) -> None:
    takers = [one for one in contestants if name in one.keys and one.row.name not in absent]
    for one in takers:
        one.runs.setdefault(name, Run()).answers.append(np.empty((0, len(workload.first))))
    for turn, begin in enumerate(range(0, len(workload), BLOCK)):
        end = min(begin + BLOCK, len(workload))
        first = turn % max(1, len(takers))
        for one in (*takers[first:], *takers[:first]):
            if one.row.name in absent:
                continue
            tell(f"{name}: {one.row.name}", 0)
            run = one.runs[name]
            q = run.answers[-1][-1] if begin else workload.first
            block = {"workload": workload.name, "begin": begin, "end": end, "q": q.tolist()}
            try:
                reply = one.worker.ask("run", key=one.keys[name], **block)
            except WorkerError as error:
                absent[one.row.name] = f"on {name}: {error}"
                continue
            run.answers[-1] = np.vstack([run.answers[-1], reply["q"]])
            run.times.append(reply["us"])
            run.raised += reply["raised"]
            tell(f"{name}: {one.row.name}", end - begin)
