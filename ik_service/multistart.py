"""Descents from many starts: until one reaches its targets and is clear, or to find the lowest cost."""

from dataclasses import dataclass

import numpy as np

from ik_service.kernel import Kernel
from ik_service.layout import AVOID, OFF, REPORT, REPORT_ONLY, Layout
from ik_service.preset import Preset
from ik_service.problem import Problem, bind
from ik_service.reach import ARRIVED
from ik_service.robot import Robot
from ik_service.seeds import Seeds, spread, squared_distance

REACHING = {"regularization": 1e-7, "smoothness": 1e-7, "hyperextension": 0.0, "retreat": 0.0, "enough": 2e-8}
"""What a reach minimises besides the errors: hardly anything, for any bias keeps it from targets near a singularity. An
arm stops at 0.02 mm and 0.008 degrees of weights 50 and 1."""

HINTED = 0.3
"""Share of an elbow hint's weight when a posture that has arrived is turned towards the hint."""

NEAR = 12
"""Starts with wrists near the target before the others. Where these fail, their neighbours fail too."""

TURNS = 12
"""Descents given to that: what is left free is a curved valley, along which a descent makes its way slowly."""

IMPROVEMENT = 1e-3
"""Relative decrease of the cost that is worth leaving the nearest solution for."""

_VALUES = slice(REPORT.index("value_left"), REPORT.index("value_right") + 1)
_POSITION = slice(REPORT.index("position_left"), REPORT.index("position_right") + 1)
_ROTATION = slice(REPORT.index("rotation_left"), REPORT.index("rotation_right") + 1)
_SETTLED = slice(REPORT.index("settled_left"), REPORT.index("settled_right") + 1)
_ITERATIONS, _CLEARANCE, _NEAREST = map(REPORT.index, ("iterations", "clearance", "nearest"))


@dataclass(slots=True)
class Start:
    """Where a start ended.

    Attributes:
        output: Answer and report one after the other, as in `layout`.
        index: Number of the start, 0 for the request's q.
    """

    output: np.ndarray
    index: int


class MultiStart:
    """Runs the kernel's `attempt` from start after start. Owns its buffers, so each thread needs its own."""

    def __init__(self, robot: Robot, kernel: Kernel, preset: Preset) -> None:
        """Bind the kernel.

        Args:
            robot: The robot.
            kernel: Its kernel.
            preset: The cost.
        """
        self._robot = robot
        layout = Layout.of(robot)
        self._problem = Problem(layout, preset)
        self._start, self._todo = np.zeros(robot.nq), np.zeros(2)
        self._output = np.zeros(layout.answer + len(REPORT))
        self._answer, self._report = self._output[: layout.answer], self._output[layout.answer :]
        inputs = (self._start, self._todo, self._problem.request, self._problem.options)
        self._attempt, self._kept_alive = bind(kernel.attempt, inputs, (self._answer, self._report))
        self._seeds = kernel.seeds
        self._spread = [spread(chain, preset.restarts) for chain in robot.arms]
        split = len(robot.arms[0].joint_names)
        self._parts = (slice(0, split), slice(split, robot.nq))

    def reach(self, problem: Problem, starts: int) -> tuple[Start | None, int, int]:
        """Try starts until both arms have arrived and are clear.

        The first start of an arm is the request's q or the tabulated posture, whichever brings the wrist nearer to the
        target; the others are further postures of the table. An arm that has arrived waits for the other; where both
        have arrived and touch, the one that touches the body starts again, and of two that touch each other they take
        turns.

        Args:
            problem: The request.
            starts: How many starts to try at most, >= 1.

        Returns:
            The start that arrived, or else the one of lowest cost among those that are clear, or None; how many were
            tried; and iterations spent.
        """
        mine, start, todo = self._problem, self._start, self._todo
        mine.copy(problem, REACHING, 0.0)
        targets = [self._target(mine, arm) for arm in (0, 1)]
        moved = self._choose_first(targets)
        margin = self._robot.collision.margin if mine.collision == AVOID else -np.inf
        weights = mine.weights
        best, lowest, iterations = None, np.inf, 0
        hunts = [_Hunt(seeds, target) for seeds, target in zip(self._seeds, targets, strict=True)]
        todo[:] = 1.0
        for k in range(starts):
            self._attempt()
            report = self._report.tolist()
            cost_l, cost_r, clearance = report[0], report[1], report[_CLEARANCE]
            iterations += int(report[_ITERATIONS])
            left, right = self._has_arrived(weights, report)
            clear = clearance >= margin
            done = clear and left and right
            if done or (clear and cost_l + cost_r < lowest):
                best, lowest = Start(self._output.copy(), k + moved), cost_l + cost_r
            if done and best is not None:
                return self._turned(best, problem, margin), k + 1, iterations
            touching = left and right
            again = self._arms_to_restart(k) if touching else (not left, not right)
            start[:] = self._answer[: len(start)]
            todo[:] = 1.0 if touching else again
            for restart, part, hunt in zip(again, self._parts, hunts, strict=True):
                if restart:
                    start[part] = hunt.next()
        return best, starts, iterations

    def _turned(self, found: Start, problem: Problem, margin: float) -> Start:
        """Turn the elbows of a posture that has arrived towards their hints, as far as arms stay there and clear."""
        if not any(problem.elbows):
            return found
        self._problem.copy(problem, {**REACHING, "enough": 0.0}, HINTED)
        self._start[:], self._todo[:] = found.output[: len(self._start)], 1.0
        for _ in range(TURNS):
            self._attempt()
            arrived = self._has_arrived(self._problem.weights, self._report.tolist())
            if not (all(arrived) and self._report[_CLEARANCE] >= margin):
                break
            found = Start(self._output.copy(), found.index)
            self._start[:] = self._answer[: len(self._start)]
        return found

    @staticmethod
    def _has_arrived(weights: list[float], report: list[float]) -> tuple[bool, bool]:
        """Whether the weighted errors of the left and of the right arm are those of an arm that has arrived."""
        position_l, rotation_l, position_r, rotation_r = weights
        _, _, e_l, e_r, w_l, w_r, *_ = report
        left = position_l * e_l * e_l + rotation_l * w_l * w_l <= ARRIVED
        right = position_r * e_r * e_r + rotation_r * w_r * w_r <= ARRIVED
        return left, right

    def _choose_first(self, targets: list[np.ndarray]) -> int:
        """Write the first start of each arm; return 0 where both are the request's q, else 1."""
        self._start[:], self._todo[:] = np.clip(self._problem.q, self._robot.lower, self._robot.upper), 0.0
        collision, self._problem.collision = self._problem.collision, OFF
        self._attempt()  # measures q
        self._problem.collision = collision
        _, _, e_l, e_r, w_l, w_r, *_ = self._report.tolist()
        moved = 0
        for arm, (e, w) in enumerate(((e_l, w_l), (e_r, w_r))):
            posture, squared = self._seeds[arm].nearest(targets[arm])
            if squared < squared_distance(e, w):
                self._start[self._parts[arm]], moved = posture, 1
        return moved

    def improve(self, problem: Problem, first: Start, starts: int) -> tuple[Start, int, int]:
        """Look for a lower cost of each arm from a fixed set of starts.

        Args:
            problem: The request.
            first: What was found from the request's q.
            starts: How many others to try.

        Returns:
            The best, the number of starts tried, and iterations spent.
        """
        mine = self._problem
        mine.copy(problem, {}, 1.0)
        collision, mine.collision = mine.collision, OFF
        report = first.output[len(self._answer) :]
        best = np.where(report[_SETTLED] > 0.0, report[_VALUES], np.inf)
        q, index, iterations = first.output[: len(self._start)].copy(), 0, 0
        self._todo[:] = 1.0
        for k in range(starts):
            for part, postures in zip(self._parts, self._spread, strict=True):
                self._start[part] = postures[k]
            self._attempt()
            iterations += int(self._report[_ITERATIONS])
            better = (self._report[_SETTLED] > 0.0) & (self._report[_VALUES] < (1.0 - IMPROVEMENT) * best)
            for i, part in enumerate(self._parts):
                if better[i]:
                    best[i], index = self._report[_VALUES][i], k + 1
                    q[part] = self._answer[part]
        mine.collision = collision
        found = self._measured(q, index)
        found.output[len(self._answer) :][_SETTLED] = np.isfinite(best)
        return found, starts + 1, iterations

    def measure(self, problem: Problem) -> Start:
        """Report on the request's q as it is, limits or no limits."""
        self._problem.copy(problem, {}, 1.0)
        self._problem.collision = min(self._problem.collision, REPORT_ONLY)  # avoidance would move q
        return self._measured(self._problem.q, 0)

    def _measured(self, q: np.ndarray, index: int) -> Start:
        self._start[:], self._todo[:] = q, 0.0
        self._attempt()
        return Start(self._output.copy(), index)

    def _arms_to_restart(self, k: int) -> tuple[bool, bool]:
        """Which arms are to leave where they touch something."""
        pair, model = int(self._report[_NEAREST]), self._robot.collision
        if pair in model.across:
            return k % 2 == 0, k % 2 == 1
        return pair in model.left, pair in model.right

    def _target(self, problem: Problem, arm: int) -> np.ndarray:
        """A target in the frame the arms are mounted in."""
        T_base_wrist = problem.target(arm)
        if not problem.waist.any():
            return T_base_wrist
        return np.linalg.inv(self._robot.waist.motion(problem.waist)) @ T_base_wrist


class _Hunt:
    """The further starts of an arm: postures with wrists near the target, then anything, limits above all."""

    def __init__(self, seeds: Seeds, target: np.ndarray) -> None:
        self._seeds, self._target, self._used = seeds, target, 0
        self._near: np.ndarray | None = None

    def next(self) -> np.ndarray:
        """Choose a start."""
        if self._near is None:
            self._near = self._seeds.sorted(self._target, NEAR)
        self._used += 1
        return self._near[self._used] if self._used < NEAR else self._seeds.wild(self._used - NEAR)
