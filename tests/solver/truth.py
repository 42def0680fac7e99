"""What must be true of any answer, by Pinocchio and coal; and requests to ask it of."""

import numpy as np
import pinocchio as pin
from body_oracle import CapsuleOracle
from hypothesis import strategies as st

from ik_proto import Status
from ik_service.robot import Robot
from ik_service.solver import Collision, Solution

rotation_vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)
far_positions = st.tuples(*[st.floats(-100.0, 100.0)] * 3).map(np.array)
near_positions = st.tuples(*[st.floats(-0.6, 0.6)] * 3).map(np.array)


@st.composite
def poses(draw: st.DrawFn) -> np.ndarray:
    """Any rotation, anywhere from inside the robot to a hundred metres away, shape (4, 4)."""
    return posed(draw(rotation_vectors), draw(far_positions | near_positions))


def posed(rotation_vector: np.ndarray, p: np.ndarray) -> np.ndarray:
    """A rigid transform, shape (4, 4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = pin.exp3(rotation_vector), p
    return T


def check_truth(
    solution: Solution, robot: Robot, left: np.ndarray, right: np.ndarray, waist: np.ndarray | None = None
) -> None:
    """Errors and torques are those of the answer; an answer that may be followed keeps the limits."""
    assert np.isfinite(solution.q).all()
    assert np.allclose(solution.tau, robot.gravity_torque(solution.q, waist), rtol=0.0, atol=1e-10)  # [N m]
    for side, (wrist, target) in enumerate(zip(robot.fk(solution.q, waist), (left, right), strict=True)):
        distance = np.linalg.norm(wrist[:3, 3] - target[:3, 3])
        assert abs(solution.position_error[side] - distance) <= 1e-9 * (1.0 + distance)
        # |R - R_target| = 2 sqrt(2) sin(angle / 2) holds at every angle, half a turn included.
        chord = np.linalg.norm(wrist[:3, :3] - target[:3, :3])
        assert abs(2.0 * np.sqrt(2.0) * np.sin(solution.rotation_error[side] / 2.0) - chord) <= 1e-7
    if solution.status is not Status.NOT_CONVERGED:
        assert (robot.lower <= solution.q).all()
        assert (solution.q <= robot.upper).all()


def check_clearance(
    solution: Solution, oracle: CapsuleOracle, collision: Collision, waist: np.ndarray | None = None
) -> None:
    """Clearance and nearest pair are coal's, or absent with checking off."""
    if collision == "off":
        assert solution.clearance == np.inf
        assert solution.nearest is None
        return
    distances = oracle.distances(solution.q, waist)
    assert abs(solution.clearance - distances.min()) <= 1e-9
    assert solution.nearest is not None
    a, b = sorted(solution.nearest)
    # Symmetric postures have two nearest pairs.
    assert distances[oracle.pairs.index((a, b))] <= distances.min() + 1e-9
