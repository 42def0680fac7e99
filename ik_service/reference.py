"""The seeds' own formulation: one 14-variable problem in CasADi's Opti, solved by Ipopt.

This is the yardstick of tests and benchmarks and never serves a request. Cost, bounds, start and options are those of
the OpenWBT and xr_teleoperate `G1_29_ArmIK`. Its rotation error is the textbook logarithm of a rotation matrix,
independent of the quaternion the kernel uses.
"""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from ik_service.kinematics import wrist_pose
from ik_service.preset import Preset
from ik_service.robot import Robot

SEED_OPTIONS: Mapping[str, Any] = {"max_iter": 50, "tol": 1e-6, "print_level": 0}
"""Ipopt options of the seeds."""


class Reference:
    """Ipopt on the whole problem, both arms at once.

    Attributes:
        objective: CasADi function (q, q_last, T_left, T_right) -> f.
    """

    def __init__(self, robot: Robot, preset: Preset, ipopt: Mapping[str, Any] = SEED_OPTIONS) -> None:
        """Set up the problem.

        Args:
            robot: The robot.
            preset: Weights of the cost.
            ipopt: Options of Ipopt.
        """
        n = robot.nq
        self._opti = ca.Opti()
        self._q = self._opti.variable(n)
        self._q_last = self._opti.parameter(n)
        self._targets = (self._opti.parameter(4, 4), self._opti.parameter(4, 4))
        self.objective = _objective(robot, preset)
        self._opti.minimize(self.objective(self._q, self._q_last, *self._targets))
        self._opti.subject_to(self._opti.bounded(robot.lower, self._q, robot.upper))
        plugin = {"print_time": False, "calc_lam_p": False}
        self._opti.solver("ipopt", plugin, {"sb": "yes", **ipopt})

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, float, bool]:
        """Solve from q, which is also the point the smoothness term pulls to.

        Args:
            left: Target of the left wrist in the base frame, shape (4, 4).
            right: Target of the right wrist in the base frame, shape (4, 4).
            q: Joint positions of the request [rad], shape (nq,).

        Returns:
            The last iterate [rad], its objective, and whether Ipopt reports success.
        """
        self._opti.set_value(self._targets[0], left)
        self._opti.set_value(self._targets[1], right)
        self._opti.set_value(self._q_last, q)
        self._opti.set_initial(self._q, q)
        try:
            self._opti.solve()
            converged = True
        except RuntimeError:
            converged = False
        values = self._opti.debug
        return np.array(values.value(self._q)).ravel(), float(values.value(self._opti.f)), converged


def _objective(robot: Robot, preset: Preset) -> ca.Function:
    q, q_last = ca.SX.sym("q", robot.nq), ca.SX.sym("q_last", robot.nq)
    targets = [ca.SX.sym(f"T_{arm.side}", 4, 4) for arm in robot.arms]
    cost = preset.regularization * ca.sumsqr(q) + preset.smoothness * ca.sumsqr(q - q_last)
    first = 0
    for arm, target in zip(robot.arms, targets, strict=True):
        wrist = wrist_pose(arm, q[first : first + len(arm.joint_names)])
        first += len(arm.joint_names)
        cost += preset.position * ca.sumsqr(wrist.p - target[:3, 3])
        cost += preset.rotation * ca.sumsqr(_log3(wrist.R @ target[:3, :3].T))
    return ca.Function("objective", [q, q_last, *targets], [cost])


def _log3(R: ca.SX) -> ca.SX:
    """Rotation vector of a matrix, shape (3,) [rad]; inaccurate within about 1e-6 rad of half a turn."""
    twice_sin_axis = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    sin, cos = ca.sqrt(ca.sumsqr(twice_sin_axis) / 4.0 + 1e-30), (ca.trace(R) - 1.0) / 2.0
    return ca.atan2(sin, cos) / (2.0 * sin) * twice_sin_axis
