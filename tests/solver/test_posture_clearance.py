"""How clear the body is in postures that nobody solved for: what MuJoCo measures between the same capsules."""

import numpy as np
import pytest
from capsule_oracles import MujocoScene

from ik_proto.robots import RobotDescription
from ik_service.gauge import Gauge
from ik_service.kernel import Kernel
from ik_service.robot import Robot


def test_it_is_what_mujoco_measures(robot: Robot, description: RobotDescription, kernel: Kernel) -> None:
    gauge, scene = Gauge(robot, kernel), MujocoScene(description)
    capsules = robot.collision.capsules
    pairs = [(capsules[i].name, capsules[j].name) for i, j in robot.collision.pairs]
    rng = np.random.default_rng(4)
    for waist in (np.zeros(3), np.array([0.3, -0.1, 0.2])):
        q = rng.uniform(robot.lower, robot.upper, (20, robot.nq))
        clearance, nearest = gauge.clearance(q, waist)
        expected = np.array([scene.distances(posture, waist, pairs) for posture in q])
        np.testing.assert_allclose(clearance, expected.min(axis=1), rtol=0.0, atol=1e-9)
        row, pair = np.unravel_index(np.argmin(expected), expected.shape)
        assert nearest == pairs[pair]
        assert row == np.argmin(clearance)
        assert clearance.min() < -0.01
        assert clearance.max() > 0.0


def test_no_waist_is_a_straight_one(robot: Robot, kernel: Kernel) -> None:
    gauge = Gauge(robot, kernel)
    q = np.random.default_rng(5).uniform(robot.lower, robot.upper, (5, robot.nq))
    bent, _ = gauge.clearance(q, np.array([0.0, 0.0, 0.3]))
    straight, _ = gauge.clearance(q)
    np.testing.assert_array_equal(straight, gauge.clearance(q, np.zeros(3))[0])
    assert not np.allclose(straight, bent, atol=1e-3)


def test_a_row_does_not_depend_on_its_neighbours(robot: Robot, kernel: Kernel) -> None:
    gauge = Gauge(robot, kernel)
    q = np.random.default_rng(6).uniform(robot.lower, robot.upper, (7, robot.nq))
    together, _ = gauge.clearance(q)
    assert together == pytest.approx([gauge.clearance(row[None])[0][0] for row in q], abs=0.0)
