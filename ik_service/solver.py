"""Inverse kinematics of both arms: one pure function of the request.

In mode `track` the kernel does it all: it starts from the request's q and stays near it. In mode `reach`, `multistart`
tries start after start. Presets that are an optimum for its own sake (`openwbt`) get a few further starts after a jump
that ended off target; a steady stream of targets never triggers that, in reach or out of it, so a tracked path is not
torn.
"""

from typing import Literal

import numpy as np

from ik_proto import Status
from ik_proto.limits import DEFAULT_STARTS
from ik_service.batch import Batch
from ik_service.kernel import ROWS, Kernel
from ik_service.layout import REPORT, Layout
from ik_service.multistart import MultiStart, Start
from ik_service.preset import Preset
from ik_service.problem import COLLISION, Collision, Problem, bind
from ik_service.robot import Robot
from ik_service.solution import BatchSolution, Solution

Mode = Literal["track", "reach"]

JUMP = 0.5
"""Displacement of an arm by a descent, Euclidean norm over its joints, that counts as a jump [rad]: 25 rad/s at 50 Hz,
more than any arm motion has."""

_CLEARANCE, _NEAREST = REPORT.index("clearance"), REPORT.index("nearest")
_OK = Status.OK  # looking a member up in its class costs a tenth of a microsecond


class Solver:
    """Solves requests one at a time.

    Cheap to make from a shared kernel; owns its buffers, so each thread needs its own.
    """

    def __init__(self, robot: Robot, kernel: Kernel, preset: Preset) -> None:
        """Bind the kernel to buffers.

        Args:
            robot: The robot; the solver keeps its own copy of the workspace.
            kernel: A kernel loaded for this robot.
            preset: The cost to minimise.
        """
        self.preset = preset
        self.kernel = kernel
        self._robot = robot.copy()
        layout = Layout.of(robot)
        self._problem = Problem(layout, preset)
        self._output = np.zeros(layout.answer + len(REPORT))
        # Slices made once: making one takes as long as using it.
        self._q, self._tau = slice(0, robot.nq), slice(robot.nq, layout.answer)
        self._report = slice(layout.answer, None)
        self._position, self._rotation = (
            slice(layout.answer + REPORT.index(key), layout.answer + REPORT.index(key) + 2)
            for key in ("position_left", "rotation_left")
        )
        self._reached = preset.tolerance(None).tolist()
        vectors = (self._problem.request, self._problem.options)
        outputs = (self._output[: layout.answer], self._output[layout.answer :])
        self._call, self._kept_alive = bind(kernel.solve, vectors, outputs)
        self._hinted, self._collision = False, "off"
        self._multistart = MultiStart(self._robot, kernel, preset)
        self._batch = Batch(self._robot, kernel, preset)
        names = [capsule.name for capsule in robot.collision.capsules]
        self._pairs = [(names[i], names[j]) for i, j in robot.collision.pairs]

    def solve(
        self,
        left_wrist: np.ndarray,
        right_wrist: np.ndarray,
        q: np.ndarray,
        *,
        mode: Mode = "track",
        collision: Collision = "avoid",
        waist: np.ndarray | None = None,
        left_elbow: np.ndarray | None = None,
        right_elbow: np.ndarray | None = None,
        weights: np.ndarray | None = None,
        starts: int = DEFAULT_STARTS,
    ) -> Solution:
        """Solve both arms.

        Args:
            left_wrist: Target `T_base_wrist` of the left arm, shape (4, 4), a rigid transform.
            right_wrist: Target of the right arm, likewise.
            q: Joint positions to start from and stay close to [rad], shape (nq,), finite.
            mode: "track" stays near q; "reach" tries up to `starts` starts until one reaches and is clear.
            collision: "off" checks nothing, "report" measures the answer, "avoid" keeps it clear.
            waist: Waist joint positions [rad]; None for a straight waist.
            left_elbow: Unit direction from shoulder to elbow in the base frame, and a confidence in [0, 1], shape (4,).
            right_elbow: The same of the right arm.
            weights: Confidence in position and orientation of each wrist target, in [0, 1], shape (2, 2).
            starts: Starts that mode "reach" may try.

        Returns:
            The answer; its arrays are the caller's.
        """
        problem = self._problem
        if not (waist is None and left_elbow is None and right_elbow is None and weights is None):
            problem.hint(waist, left_elbow, right_elbow, weights)
            self._reached = self.preset.tolerance(weights).tolist()
            self._hinted = True
        elif self._hinted:
            problem.hint(None, None, None, None)
            self._reached = self.preset.tolerance(None).tolist()
            self._hinted = False
        # Written out rather than called: this runs a hundred thousand times a second.
        problem.q[:], problem.left[:], problem.right[:] = q, left_wrist, right_wrist
        if collision is not self._collision:
            problem.collision = COLLISION[collision]
            self._collision = collision
        if mode == "reach":
            best, tried, iterations = self._multistart.reach(problem, starts)
            if best is not None:
                return self._solution(best.output, best.index, tried, iterations, best_effort=True)
            # Nothing that is clear was found; what track finds is.
            self._call()
            solution = self._solution(self._output.copy(), 0, 1, 0)
            solution.starts, solution.iterations = tried, solution.iterations + iterations
            return solution
        self._call()
        solution = self._solution(self._output.copy(), 0, 1, 0)
        if self.preset.restarts and collision != "avoid" and self._off_target_after_a_jump(solution, q):
            return self._restarted(solution)
        return solution

    def solve_batch(
        self,
        left_wrist: np.ndarray,
        right_wrist: np.ndarray,
        q: np.ndarray,
        *,
        mode: Mode = "track",
        collision: Collision = "avoid",
        waist: np.ndarray | None = None,
        left_elbow: np.ndarray | None = None,
        right_elbow: np.ndarray | None = None,
        weights: np.ndarray | None = None,
        starts: int = DEFAULT_STARTS,
    ) -> BatchSolution:
        """Solve many problems; each row's answer is what `solve` gives for it, to the last bit.

        Rows that one call of the kernel solves are solved side by side, in as many threads as there are cores; the
        others (mode "reach", restarts, and what is left of a block) one after the other.

        Args:
            left_wrist: Targets of the left arm, shape (N, 4, 4).
            right_wrist: Targets of the right arm, shape (N, 4, 4).
            q: Joint positions to start from [rad], shape (N, nq).
            mode: As for `solve`, for all rows.
            collision: As for `solve`, for all rows.
            waist: Waist joint positions [rad], shape (N, n_waist).
            left_elbow: Elbow hints, shape (N, 4).
            right_elbow: Elbow hints, shape (N, 4).
            weights: Confidences, shape (N, 2, 2).
            starts: As for `solve`, for all rows.

        Returns:
            The answers.
        """
        hints = {"waist": waist, "left_elbow": left_elbow, "right_elbow": right_elbow, "weights": weights}

        def alone(k: int) -> Solution:
            row = {key: None if rows is None else rows[k] for key, rows in hints.items()}
            return self.solve(left_wrist[k], right_wrist[k], q[k], mode=mode, collision=collision, starts=starts, **row)

        # Blocks that the kernel takes whole are solved side by side, what is left over one by one.
        side_by_side = len(q) - len(q) % ROWS if mode == "track" else 0
        rest = [alone(k) for k in range(side_by_side, len(q))]
        if not side_by_side:
            return BatchSolution.of(rest)
        first = {key: None if rows is None else rows[:side_by_side] for key, rows in hints.items()}
        rows = (left_wrist[:side_by_side], right_wrist[:side_by_side], q[:side_by_side])
        answers, special = self._batch.interpret(
            self._batch.run(*rows, COLLISION[collision], **first), first["weights"]
        )
        if self.preset.restarts and collision != "avoid":
            special = special | self._batch.off_target_after_a_jump(answers, rows[2], JUMP)
        for k in np.flatnonzero(special):
            answers.put(k, alone(k))
        return answers.extended(rest)

    def _solution(
        self, output: np.ndarray, start: int, starts: int, others: int, best_effort: bool = False
    ) -> Solution:
        """Interpret what the kernel says; `others` are iterations of other starts.

        A best effort need not have settled.
        """
        report = output[self._report].tolist()
        cost_l, cost_r, e_l, e_r, w_l, w_r, settled_l, settled_r, iterations, clearance, place, diverted = report
        limit_l, limit_r, angle_l, angle_r = self._reached
        if e_l <= limit_l and e_r <= limit_r and w_l <= angle_l and w_r <= angle_r:
            status = _OK
        elif diverted:
            status = Status.BLOCKED
        elif best_effort or self.preset.retreat or (settled_l and settled_r):
            status = Status.UNREACHABLE
        else:
            return self._not_converged(int(iterations) + others)
        return Solution(
            output[self._q],
            status,
            output[self._position],
            output[self._rotation],
            output[self._tau],
            cost_l + cost_r,
            int(iterations) + others,
            clearance,
            self._pairs[int(place)] if place >= 0.0 else None,
            start,
            starts,
        )

    def _not_converged(self, iterations: int) -> Solution:
        """Echo the request's q, with the truth about it."""
        output = self._multistart.measure(self._problem).output
        clearance, place = output[self._report][_CLEARANCE], int(output[self._report][_NEAREST])
        return Solution(
            output[self._q],
            Status.NOT_CONVERGED,
            output[self._position],
            output[self._rotation],
            output[self._tau],
            float(output[self._report][:2].sum()),
            iterations,
            float(clearance),
            self._pairs[place] if place >= 0 else None,
        )

    def _off_target_after_a_jump(self, solution: Solution, q: np.ndarray) -> bool:
        if solution.status is Status.OK:
            return False
        split = len(self._robot.arms[0].joint_names)
        displacement = solution.q - q
        return any(part @ part > JUMP * JUMP for part in (displacement[:split], displacement[split:]))

    def _restarted(self, solution: Solution) -> Solution:
        first = Start(self._output.copy(), 0)
        best, tried, iterations = self._multistart.improve(self._problem, first, self.preset.restarts)
        iterations += solution.iterations
        return self._solution(best.output, best.index, tried, iterations)
