"""What every measurement works with: the robot, the solvers, an independent measure of clearance, and sizes."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from benchmarks.limits.geometry import SelfDistances
from ik_proto.robots import load_description
from ik_service.kernel import Kernel, load_kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solver import Solver

Tell = Callable[[int, int], None]
"""Called with how much is done, and of how much."""


@dataclass(frozen=True)
class Sizes:
    """How much is measured.

    Attributes:
        frames: Longest part of a path that is followed; None for all of a recording.
        paths: Random paths.
        targets: Targets of reach mode.
        budget_targets: Those on which budgets of starts are compared.
        requests: Requests of the safety measurement.
        walked: Answers whose path is looked at all along.
        rounds: Times a timed path is followed.
        batches: Batch sizes.
        batch_seconds: Time for each of them [s].
        pair_points: Kernels with a part of the pairs.
    """

    frames: int | None = None
    paths: int = 8
    targets: int = 10_000
    budget_targets: int = 1000
    requests: int = 1_000_000
    walked: int = 10_000
    rounds: int = 5
    batches: tuple[int, ...] = (1, 8, 64, 512, 4096)
    batch_seconds: float = 2.0
    pair_points: int = 6


FULL = Sizes()
QUICK = Sizes(
    frames=300,
    paths=3,
    targets=500,
    budget_targets=100,
    requests=8000,
    walked=200,
    rounds=2,
    batch_seconds=0.2,
    pair_points=3,
)


@dataclass(frozen=True)
class Rig:
    """Robot and solvers.

    Attributes:
        robot: The robot.
        kernel: Its kernel.
        precise: The solver that is measured.
        openwbt: The cost of the seeds, as a measure of smoothness.
        distances: The independent measure of clearance.
        sizes: How much is measured.
    """

    robot: Robot
    kernel: Kernel
    precise: Solver
    openwbt: Solver
    distances: SelfDistances
    sizes: Sizes

    @classmethod
    def build(cls, robot_name: str, sizes: Sizes, compiled: bool = True) -> "Rig":
        """Load a robot and its kernel."""
        description = load_description(robot_name)
        robot = Robot.load(description)
        kernel = load_kernel(robot, compiled)
        precise, openwbt = (Solver(robot, kernel, Preset.of(description, name)) for name in ("precise", "openwbt"))
        return cls(robot, kernel, precise, openwbt, SelfDistances(robot), sizes)


@dataclass(frozen=True)
class Row:
    """One line of the table asked/measured.

    Attributes:
        what: What is measured.
        measured: The outcome, with its unit.
        asked: What was asked for, empty where nothing was.
        met: Whether the outcome is as asked; None where nothing was.
        judged: Whether missing it is a failure of the command; speed depends on the machine and is not.
    """

    what: str
    measured: str
    asked: str = ""
    met: bool | None = None
    judged: bool = False

    @property
    def failed(self) -> bool:
        """Whether the command fails for it."""
        return self.judged and not self.met


@dataclass(frozen=True)
class Result:
    """What a measurement found.

    Attributes:
        rows: Lines of the table.
        numbers: All of it, JSON-ready; keys carry their units.
    """

    rows: list[Row]
    numbers: dict[str, Any]


def at_most(what: str, value: float, limit: float, unit: str, judged: bool = True) -> Row:
    """A row whose value may not exceed a limit; NaN exceeds everything."""
    return Row(what, f"{value:.4g} {unit}".strip(), f"≤ {limit:g} {unit}".strip(), bool(value <= limit), judged)


def at_least(what: str, value: float, limit: float, unit: str, judged: bool = True) -> Row:
    """A row whose value may not fall below a limit; NaN falls below everything."""
    return Row(what, f"{value:.6g} {unit}".strip(), f"≥ {limit:,.10g} {unit}".strip(), bool(value >= limit), judged)


def shown(what: str, value: float, unit: str) -> Row:
    """A row for information."""
    return Row(what, f"{value:.4g} {unit}".strip())
