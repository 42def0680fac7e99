"""Inverse kinematics of both arms: one pure function of the request.

Each arm is solved on its own by its kernel, starting from the request's q. When the target was a jump and the descent
ended in a place that does not reach it, a fixed set of other starts is tried and the lowest cost kept. A steady
stream of targets never triggers that, in reach or out of it, so a tracked path is not torn.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import casadi as ca
import numpy as np

from ik_proto import Status
from ik_service.descent import REPORT, TOLERANCE
from ik_service.kernel import Kernel
from ik_service.objective import Preset
from ik_service.robot import ArmChain, Robot

MAX_CALLS = 4
"""Calls of the kernel for one descent, each worth `descent.ITERATIONS`; hardly any descent needs a second."""

EXTRA_STARTS = 8
"""Other starts tried after a jump. On random cold targets 8 leave one in a hundred worse than Ipopt from the
request's q; 3 leave three."""

JUMP = 0.5
"""Displacement of an arm by a descent, Euclidean norm over its joints, that counts as a jump [rad]: 25 rad/s at 50 Hz,
more than any arm motion has."""

IMPROVEMENT = 1e-3
"""Relative decrease of the cost that is worth leaving the nearest solution for."""

_POSITION_ERROR, _ROTATION_ERROR, _DAMPING = map(REPORT.index, ("position_error", "rotation_error", "damping"))


@dataclass(slots=True)
class Solution:
    """Answer to one request.

    Errors and objective are those of the returned q.

    Attributes:
        q: Joint positions [rad], shape (nq,): within the limits, or the request's own q when not converged.
        status: OK, UNREACHABLE or NOT_CONVERGED.
        position_error: Distance of each wrist from its target [m], shape (2,).
        rotation_error: Angle between each wrist and its target [rad], shape (2,).
        tau: Gravity torques at q [N m], shape (nq,).
        objective: Cost of both arms together.
        iterations: Newton iterations spent, both arms and all starts together.
    """

    q: np.ndarray
    status: Status
    position_error: np.ndarray
    rotation_error: np.ndarray
    tau: np.ndarray
    objective: float
    iterations: int


class Solver:
    """Solves requests one at a time.

    Cheap to make from a shared kernel; owns its buffers, so each thread needs its own.
    """

    def __init__(self, robot: Robot, kernel: Kernel) -> None:
        """Bind the kernel to buffers.

        Args:
            robot: The robot; the solver keeps its own copy of the workspace.
            kernel: A kernel loaded for this robot.
        """
        self.preset = kernel.preset
        self.kernel = kernel
        self._robot = robot.copy()
        self._request, self._answer, self._torques = (np.zeros(robot.nq) for _ in range(3))
        self._reports = np.zeros((2, len(REPORT)))
        split = len(robot.arms[0].joint_names)
        self._left, self._right = (
            _Arm(chain, descent, self._request[part], (self._answer[part], report, self._torques[part]), self.preset)
            for chain, descent, part, report in zip(
                robot.arms, kernel.descents, (slice(split), slice(split, None)), self._reports, strict=True
            )
        )

    def solve(self, left_wrist: np.ndarray, right_wrist: np.ndarray, q: np.ndarray) -> Solution:
        """Solve both arms.

        Args:
            left_wrist: Target `T_base_wrist` of the left arm, shape (4, 4), a rigid transform.
            right_wrist: Target of the right arm, likewise.
            q: Joint positions to start from and stay close to [rad], shape (nq,), finite.

        Returns:
            The answer; its arrays are the caller's.
        """
        self._request[:] = q
        left, right = self._left.solve(left_wrist), self._right.solve(right_wrist)
        if not (left and right):
            return self._not_converged(left_wrist, right_wrist, q)
        return Solution(
            self._answer.copy(),
            Status.OK if self._left.reached and self._right.reached else Status.UNREACHABLE,
            self._reports[:, _POSITION_ERROR].copy(),
            self._reports[:, _ROTATION_ERROR].copy(),
            self._torques.copy(),
            self._left.cost + self._right.cost,
            self._left.iterations + self._right.iterations,
        )

    def _not_converged(self, left_wrist: np.ndarray, right_wrist: np.ndarray, q: np.ndarray) -> Solution:
        """Echo the request's q, with the truth about it."""
        position_error, rotation_error = self._robot.wrist_errors(q, left_wrist, right_wrist)
        objective = (
            self.preset.position * (position_error**2).sum()
            + self.preset.rotation * (rotation_error**2).sum()
            + self.preset.regularization * (q**2).sum()
        )
        return Solution(
            q.copy(),
            Status.NOT_CONVERGED,
            position_error,
            rotation_error,
            self._robot.gravity_torque(q),
            float(objective),
            self._left.iterations + self._right.iterations,
        )


class _Arm:
    """One arm's descent bound to buffers.

    Attributes:
        cost: Cost of the answer.
        reached: Whether the answer's errors are within the preset's thresholds.
        iterations: Newton iterations spent on the answer.
    """

    def __init__(
        self,
        chain: ArmChain,
        descent: ca.Function,
        request: np.ndarray,
        results: tuple[np.ndarray, np.ndarray, np.ndarray],
        preset: Preset,
    ) -> None:
        """Bind; `request` is read, `results` (answer, report, torques) are written by every solve."""
        self.cost, self.reached, self.iterations = 0.0, False, 0
        self._kept_alive: list[Any] = []
        self._request, self._results = request, results
        self._answer, self._report, _ = results
        self._max_position_error = preset.unreachable_position
        self._max_rotation_error = preset.unreachable_rotation
        self._extra_starts = _spread(chain, EXTRA_STARTS)
        target = np.zeros(16)
        self._target = target.reshape(4, 4).T  # CasADi stores matrices by columns
        self._start, self._damping = np.zeros(len(request)), np.zeros(1)
        # The usual call starts at the request's q, undamped, and copies neither.
        self._descend = self._bind(descent, (request, target, request, np.zeros(1)), results)
        self._descend_from = self._bind(descent, (self._start, target, request, self._damping), results)

    def _bind(
        self, descent: ca.Function, arguments: tuple[np.ndarray, ...], results: tuple[np.ndarray, ...]
    ) -> Callable[[], None]:
        """Tie a descent to arrays, which the returned call reads and writes in place."""
        buffer: Any  # the stubs of set_arg and set_res ask for a size that a memoryview brings along
        call: Callable[[], None]
        buffer, call = cast(Any, descent).buffer()
        for i, argument in enumerate(arguments):
            buffer.set_arg(i, argument.data)
        for i, result in enumerate(results):
            buffer.set_res(i, result.data)
        self._kept_alive.append((buffer, arguments, results))  # CasADi holds bare pointers to them
        return call

    def solve(self, target: np.ndarray) -> bool:
        """Solve; return whether the answer is a local minimum."""
        self._target[:] = target
        self.iterations = 0
        self._descend()
        converged = self._finish()
        if converged and (self.reached or not self._jumped()):
            return True
        return self._try_others(converged)

    def _jumped(self) -> bool:
        displacement = self._answer - self._request
        return displacement.dot(displacement) > JUMP * JUMP

    def _finish(self) -> bool:
        """Resume a descent until it converges or may go on no longer, and read its report."""
        for _ in range(MAX_CALLS - 1):
            if self._read():
                return True
            self._start[:] = self._answer
            self._damping[:] = self._report[_DAMPING]
            self._descend_from()
        return self._read()

    def _read(self) -> bool:
        self.cost, gradient, position_error, rotation_error, iterations, _ = self._report.tolist()
        self.reached = position_error <= self._max_position_error and rotation_error <= self._max_rotation_error
        self.iterations += int(iterations)
        return gradient <= TOLERANCE

    def _try_others(self, converged: bool) -> bool:
        best = (self.cost if converged else np.inf, self.reached, [result.copy() for result in self._results])
        for start in self._extra_starts:
            self._start[:], self._damping[:] = start, 0.0
            self._descend_from()
            if self._finish() and self.cost < (1.0 - IMPROVEMENT) * best[0]:
                best = (self.cost, self.reached, [result.copy() for result in self._results])
        self.cost, self.reached, kept = best
        for result, value in zip(self._results, kept, strict=True):
            result[:] = value
        return self.cost < np.inf


def _spread(chain: ArmChain, count: int) -> np.ndarray:
    """Points spread evenly over the middle 80 % of the joint limits, shape (count, n): a Halton sequence."""
    primes = [p for p in range(2, 8 * len(chain.joint_names)) if all(p % d for d in range(2, p))]
    unit = np.array([[_radical_inverse(k, prime) for prime in primes] for k in range(1, count + 1)])
    unit = unit[:, : len(chain.joint_names)]
    return chain.lower + (0.1 + 0.8 * unit) * (chain.upper - chain.lower)


def _radical_inverse(k: int, base: int) -> float:
    """Digits of k in a base, mirrored at the point (J. H. Halton, Numerische Mathematik 2, 1960)."""
    value, digit = 0.0, 1.0 / base
    while k:
        value += digit * (k % base)
        k //= base
        digit /= base
    return value
