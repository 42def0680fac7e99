"""What a solve answers."""

from dataclasses import dataclass

import numpy as np

from ik_proto import Status


@dataclass(slots=True)
class Solution:
    """Answer to one request.

    Errors, clearance and objective are those of the returned q.

    Attributes:
        q: Joint positions [rad], shape (nq,): within the limits, or the request's own q when not converged.
        status: OK, UNREACHABLE, BLOCKED or NOT_CONVERGED.
        position_error: Distance of each wrist from its target [m], shape (2,).
        rotation_error: Angle between each wrist and its target [rad], shape (2,).
        tau: Gravity torques at q [N m], shape (nq,).
        objective: Cost of both arms together.
        iterations: Newton iterations spent, both arms and all starts together.
        clearance: Smallest distance of any checked pair of capsules [m]; infinite with nothing checked.
        nearest: Names of the capsules of that pair; None with nothing checked.
        start: Which start won: 0 for the request's q.
        starts: Starts tried.
    """

    q: np.ndarray
    status: Status
    position_error: np.ndarray
    rotation_error: np.ndarray
    tau: np.ndarray
    objective: float
    iterations: int
    clearance: float
    nearest: tuple[str, str] | None
    start: int = 0
    starts: int = 1


@dataclass(slots=True)
class BatchSolution:
    """Answers to N requests, each as in `Solution`.

    Attributes:
        q: Joint positions [rad], shape (N, nq).
        statuses: What each came to.
        position_error: Distance of each wrist from its target [m], shape (N, 2).
        rotation_error: Angle between each wrist and its target [rad], shape (N, 2).
        tau: Gravity torques at q [N m], shape (N, nq).
        objective: Cost of both arms together, shape (N,).
        iterations: Newton iterations of all.
        clearance: Smallest distance of any checked pair of capsules [m], shape (N,); infinite with nothing checked.
        start: Which start won, shape (N,), integers.
    """

    q: np.ndarray
    statuses: list[Status]
    position_error: np.ndarray
    rotation_error: np.ndarray
    tau: np.ndarray
    objective: np.ndarray
    iterations: int
    clearance: np.ndarray
    start: np.ndarray

    @classmethod
    def of(cls, solutions: list[Solution]) -> "BatchSolution":
        """Put single answers together."""
        return cls(
            q=np.array([solution.q for solution in solutions]),
            statuses=[solution.status for solution in solutions],
            position_error=np.array([solution.position_error for solution in solutions]),
            rotation_error=np.array([solution.rotation_error for solution in solutions]),
            tau=np.array([solution.tau for solution in solutions]),
            objective=np.array([solution.objective for solution in solutions]),
            iterations=sum(solution.iterations for solution in solutions),
            clearance=np.array([solution.clearance for solution in solutions]),
            start=np.array([solution.start for solution in solutions]),
        )

    def extended(self, solutions: list[Solution]) -> "BatchSolution":
        """Append single answers."""
        if not solutions:
            return self
        more = BatchSolution.of(solutions)
        return BatchSolution(
            q=np.concatenate((self.q, more.q)),
            statuses=self.statuses + more.statuses,
            position_error=np.concatenate((self.position_error, more.position_error)),
            rotation_error=np.concatenate((self.rotation_error, more.rotation_error)),
            tau=np.concatenate((self.tau, more.tau)),
            objective=np.concatenate((self.objective, more.objective)),
            iterations=self.iterations + more.iterations,
            clearance=np.concatenate((self.clearance, more.clearance)),
            start=np.concatenate((self.start, more.start)),
        )

    def put(self, k: int, solution: Solution) -> None:
        """Replace an answer; iterations add up."""
        self.q[k], self.tau[k] = solution.q, solution.tau
        self.statuses[k] = solution.status
        self.position_error[k], self.rotation_error[k] = solution.position_error, solution.rotation_error
        self.objective[k], self.clearance[k], self.start[k] = solution.objective, solution.clearance, solution.start
        self.iterations += solution.iterations
