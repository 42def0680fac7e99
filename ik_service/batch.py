"""Many problems at once: the compiled solve mapped over rows, in as many threads as there are cores.

The mapped function calls the same code as a single solve, so a row's answer does not depend on its company.
"""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ik_proto import Status
from ik_service.kernel import ROWS, Kernel
from ik_service.layout import REPORT, Layout
from ik_service.preset import Preset
from ik_service.problem import Problem, bind, write_hints
from ik_service.robot import Robot
from ik_service.solution import BatchSolution

_COLUMNS = {key: place for place, key in enumerate(REPORT)}


class Batch:
    """Runs batches through a kernel. Threads are started on first use, and end with the process."""

    def __init__(self, robot: Robot, kernel: Kernel, preset: Preset) -> None:
        """Take what a batch needs.

        Args:
            robot: The robot.
            kernel: Its kernel.
            preset: The cost.
        """
        self._layout, self._kernel, self._preset = Layout.of(robot), kernel, preset
        self._split = len(robot.arms[0].joint_names)
        self._workers: list[_Worker] = []
        self._pool: ThreadPoolExecutor | None = None

    def run(
        self,
        left_wrist: np.ndarray,
        right_wrist: np.ndarray,
        q: np.ndarray,
        collision: float,
        waist: np.ndarray | None,
        left_elbow: np.ndarray | None,
        right_elbow: np.ndarray | None,
        weights: np.ndarray | None,
    ) -> np.ndarray:
        """Solve rows.

        Args:
            left_wrist: Targets of the left arm, shape (N, 4, 4), N a multiple of `kernel.ROWS`.
            right_wrist: Targets of the right arm, shape (N, 4, 4).
            q: Joint positions to start from [rad], shape (N, nq).
            collision: One of `layout.OFF`, `layout.REPORT_ONLY` and `layout.AVOID`.
            waist: Waist joint positions [rad], shape (N, n_waist), or None.
            left_elbow: Elbow hints, shape (N, 4), or None.
            right_elbow: Elbow hints, shape (N, 4), or None.
            weights: Confidences, shape (N, 2, 2), or None.

        Returns:
            Answers and reports side by side, shape (N, answer + report).
        """
        N, layout = len(q), self._layout
        if not self._workers:
            self._workers = [_Worker(layout, self._kernel) for _ in range(os.cpu_count() or 1)]
            self._pool = ThreadPoolExecutor(len(self._workers), thread_name_prefix="batch")
        requests, options = np.empty((N, layout.request)), np.empty((N, layout.options))
        requests[:, : layout.nq] = q
        requests[:, layout.nq : layout.nq + 16] = left_wrist.reshape(N, 16)
        requests[:, layout.nq + 16 :] = right_wrist.reshape(N, 16)
        problem = Problem(layout, self._preset)
        problem.collision = collision
        options[:] = problem.options
        write_hints(options, layout, self._preset, waist, left_elbow, right_elbow, weights)
        outputs = np.empty((N, layout.answer + len(REPORT)))
        chunks = np.array_split(np.arange(0, N, ROWS), len(self._workers))
        assert self._pool is not None
        jobs = [
            self._pool.submit(worker.run, chunk, requests, options, outputs)
            for worker, chunk in zip(self._workers, chunks, strict=False)
        ]
        for job in jobs:
            job.result()
        return outputs

    def interpret(self, outputs: np.ndarray, weights: np.ndarray | None) -> tuple[BatchSolution, np.ndarray]:
        """Read what `run` returns.

        Args:
            outputs: Answers and reports, shape (N, answer + report).
            weights: Confidences, as for `run`.

        Returns:
            The answers, and which of them have not converged, shape (N,).
        """
        layout, preset = self._layout, self._preset
        reports = outputs[:, layout.answer :]

        def columns(first: str, count: int = 2) -> np.ndarray:
            return reports[:, _COLUMNS[first] : _COLUMNS[first] + count]

        position, rotation = columns("position_left"), columns("rotation_left")
        reached = np.all(np.hstack((position, rotation)) <= preset.tolerance(weights), axis=1)
        diverted = reports[:, _COLUMNS["diverted"]] > 0.0
        settled = (columns("settled_left") > 0.0).all(1) | bool(preset.retreat)
        statuses = [
            Status.OK if ok else Status.BLOCKED if blocked else Status.UNREACHABLE
            for ok, blocked in zip(reached, diverted, strict=True)
        ]
        answers = BatchSolution(
            q=outputs[:, : layout.nq].copy(),
            statuses=statuses,
            position_error=position.copy(),
            rotation_error=rotation.copy(),
            tau=outputs[:, layout.nq : layout.answer].copy(),
            objective=reports[:, _COLUMNS["value_left"]] + reports[:, _COLUMNS["value_right"]],
            iterations=int(reports[:, _COLUMNS["iterations"]].sum()),
            clearance=reports[:, _COLUMNS["clearance"]].copy(),
            start=np.zeros(len(outputs), dtype=int),
        )
        return answers, ~(reached | diverted | settled)

    def off_target_after_a_jump(self, answers: BatchSolution, q: np.ndarray, jump: float) -> np.ndarray:
        """Find answers off target with an arm displaced by more than `jump` [rad], shape (N,)."""
        squares = (answers.q - q) ** 2
        jumped = (squares[:, : self._split].sum(1) > jump**2) | (squares[:, self._split :].sum(1) > jump**2)
        return jumped & np.array([status is not Status.OK for status in answers.statuses])


class _Worker:
    """One thread's buffers."""

    def __init__(self, layout: Layout, kernel: Kernel) -> None:
        # CasADi stores matrices by columns: a column there is a row here.
        self._request, self._options = np.empty((ROWS, layout.request)), np.empty((ROWS, layout.options))
        self._answer, self._report = np.empty((ROWS, layout.answer)), np.empty((ROWS, len(REPORT)))
        inputs, outputs = (self._request, self._options), (self._answer, self._report)
        self._call, self._kept_alive = bind(kernel.solve_rows, inputs, outputs)
        self._split = layout.answer

    def run(self, firsts: np.ndarray, requests: np.ndarray, options: np.ndarray, outputs: np.ndarray) -> None:
        """Solve the blocks of `ROWS` that begin at `firsts`."""
        for first in firsts.tolist():
            rows = slice(first, first + ROWS)
            self._request[:], self._options[:] = requests[rows], options[rows]
            self._call()  # lets other threads run meanwhile
            outputs[rows, : self._split], outputs[rows, self._split :] = self._answer, self._report
