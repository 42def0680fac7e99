"""`Service` with a filter over its answers: they stay true, and safe."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ik_proto import Collision, SolveReply, SolveRequest, request_document
from ik_proto.smoothing import WeightedMovingFilter
from ik_service.engine import Engine
from ik_service.metrics import Meter
from ik_service.service import Service
from ik_service.solver import Solver


@pytest.fixture
def service(engine: Engine) -> Service:
    return Service(engine.copy(), Meter("test"))


def test_smoothing_tells_the_truth_about_the_filtered_joints(
    engine: Engine, service: Service, solver: Solver, solve_request: Callable[[int], SolveRequest]
) -> None:
    smoothing = WeightedMovingFilter()
    raw = []
    for seed in range(6):
        request = replace(solve_request(seed), collision="report", waist=np.array([0.0, 0.0, 0.01 * seed]))
        reply = service.handle(request_document(request), smoothing)
        targets = request.left_wrist, request.right_wrist
        raw.append(solver.solve(*targets, request.q, collision="report", waist=request.waist).q)
        assert isinstance(reply, SolveReply)
        assert reply.sol_q is not None
        expected = raw[-1] if seed < 3 else np.average(raw[-4:], axis=0, weights=[0.1, 0.2, 0.3, 0.4])
        np.testing.assert_allclose(reply.sol_q, expected, atol=1e-12)
        distances, angles = engine.robot.wrist_errors(reply.sol_q, *targets, request.waist)
        tau = engine.robot.gravity_torque(reply.sol_q, request.waist)
        for said, true in ((reply.position_error, distances), (reply.rotation_error, angles), (reply.tau, tau)):
            assert said is not None
            np.testing.assert_allclose(said, true, atol=1e-9)
        measured = engine.gauge.measure(*targets, reply.sol_q, "report", request.waist)
        assert (reply.clearance, reply.nearest) == (measured.clearance, measured.nearest)


@pytest.mark.parametrize("collision", ["report", "avoid"])
def test_smoothing_does_not_lead_through_the_body(engine: Engine, service: Service, collision: Collision) -> None:
    """The right hand goes from above the left one to below it: both are clear, and their mean is in the left hand."""
    margin, robot = engine.robot.collision.margin, engine.robot
    smoothing, replies = WeightedMovingFilter(), []
    for k, pitch in enumerate([-1.0, -0.99, 0.0, 0.01, 0.02, 0.03, 0.04]):
        q = np.array([-0.5, 0.2, -0.6, 0.6, 0.0, 0.0, 0.0, pitch, -0.2, 0.6, 0.6, 0.0, 0.0, 0.0])
        left, right = robot.fk(q)
        request = SolveRequest(left_wrist=left, right_wrist=right, q=q, dq=np.zeros(14), collision=collision, id=k)
        reply = service.handle(request_document(request), smoothing)
        assert isinstance(reply, SolveReply)
        assert reply.clearance is not None
        assert reply.position_error is not None
        replies.append(reply)
    clearances = [reply.clearance for reply in replies]
    lags = [reply.position_error.max() for reply in replies]
    assert lags[-1] > 1e-3  # it filters again once that is safe
    if collision == "avoid":
        assert min(clearances) >= margin
        assert lags[3] < 1e-4
    else:
        assert clearances[3] < 0.0
        assert lags[3] > 0.1
