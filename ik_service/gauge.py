"""What joint positions are worth that no solver found: a filter's, for example."""

from typing import NamedTuple

import numpy as np

from ik_service.kernel import Kernel
from ik_service.layout import OFF, REPORT, REPORT_ONLY, Layout
from ik_service.multistart import MultiStart
from ik_service.preset import Preset
from ik_service.problem import Collision, Problem
from ik_service.robot import Robot

_POSITION, _ROTATION = REPORT.index("position_left"), REPORT.index("rotation_left")
_CLEARANCE, _NEAREST = REPORT.index("clearance"), REPORT.index("nearest")


_ANYWHERE = np.eye(4)


class Measurement(NamedTuple):
    """What is true of joint positions; fields as in `solution.Solution`."""

    position_error: np.ndarray
    rotation_error: np.ndarray
    tau: np.ndarray
    clearance: float
    nearest: tuple[str, str] | None


class Gauge:
    """Measures joint positions with the kernel. Owns its buffers, so each thread needs its own."""

    def __init__(self, robot: Robot, kernel: Kernel) -> None:
        """Bind the kernel.

        Args:
            robot: The robot.
            kernel: Its kernel.
        """
        self._robot, self._kernel = robot, kernel
        self._layout = Layout.of(robot)
        # A measurement asks for no cost, so these weights are never seen.
        preset = Preset("gauge", position=1.0, rotation=1.0, regularization=1.0, smoothness=0.0)
        self._problem = Problem(self._layout, preset)
        self._kernel_calls = MultiStart(robot.copy(), kernel, preset)

    def clearance(self, q: np.ndarray, waist: np.ndarray | None = None) -> tuple[np.ndarray, tuple[str, str] | None]:
        """Measure how clear of itself the body is in some postures.

        Args:
            q: Joint positions [rad], shape (k, nq).
            waist: Waist joint positions [rad], the same for all; None for a straight waist.

        Returns:
            Smallest distance between two capsules in each posture [m], shape (k,), and the names of the nearest two of
            all; None where the robot has none.
        """
        problem = self._problem
        problem.hint(waist, None, None, None)
        problem.collision = REPORT_ONLY
        clearance, places = np.empty(len(q)), np.empty(len(q), dtype=int)
        for row, posture in enumerate(q):
            problem.pose(posture, _ANYWHERE, _ANYWHERE)
            report = self._kernel_calls.measure(problem).output[self._layout.answer :]
            clearance[row], places[row] = report[_CLEARANCE], report[_NEAREST]
        return clearance, self._pair(int(places[np.argmin(clearance)]))

    def copy(self) -> "Gauge":
        """Make a gauge for another thread; the kernel is shared."""
        return Gauge(self._robot, self._kernel)

    def measure(
        self,
        left_wrist: np.ndarray,
        right_wrist: np.ndarray,
        q: np.ndarray,
        collision: Collision,
        waist: np.ndarray | None = None,
    ) -> Measurement:
        """Measure joint positions.

        Args:
            left_wrist: Target `T_base_wrist` of the left arm, shape (4, 4).
            right_wrist: Target of the right arm, likewise.
            q: Joint positions [rad], shape (nq,).
            collision: "off" leaves the clearance unmeasured.
            waist: Waist joint positions [rad]; None for a straight waist.

        Returns:
            Errors, torques and clearance at q.
        """
        problem = self._problem
        problem.hint(waist, None, None, None)
        problem.pose(q, left_wrist, right_wrist)
        problem.collision = OFF if collision == "off" else REPORT_ONLY  # to avoid would be to move
        output = self._kernel_calls.measure(problem).output
        report = output[self._layout.answer :]
        nearest = self._pair(int(report[_NEAREST]))
        return Measurement(
            report[_POSITION : _POSITION + 2],
            report[_ROTATION : _ROTATION + 2],
            output[self._layout.nq : self._layout.answer],
            float(report[_CLEARANCE]),
            nearest,
        )

    def _pair(self, place: int) -> tuple[str, str] | None:
        """Names of the capsules of a pair; None for none."""
        if place < 0:
            return None
        i, j = self._robot.collision.pairs[place]
        return self._robot.collision.capsules[i].name, self._robot.collision.capsules[j].name
