"""Scripted paths: they start where the robot is, move smoothly, and stay where the arms can follow."""

from itertools import pairwise

import numpy as np
import pytest

from ik_client import IKClient
from ik_proto import Array
from ik_proto.robots import RobotDescription
from sim_client.arms import ArmKinematics
from sim_client.paths import DEFAULT_PATH, PATHS, ScriptedPath
from sim_client.poses import difference
from sim_client.robot import CONTROL_PERIOD, SimRobot
from sim_client.sources import APPROACH_TIME, Approach, Markers

MAX_SPEED = 1.0
"""[m/s] at a wrist."""

MAX_TURN = 2.5
"""[rad/s] at a wrist."""

MAX_STEP = 0.06
"""Of a joint from tick to tick [rad]: 3 rad/s."""


def sampled(path: ScriptedPath, seconds: float) -> list[tuple[Array, Array]]:
    return [path.poses(i * CONTROL_PERIOD) for i in range(round(seconds / CONTROL_PERIOD))]


@pytest.fixture(params=sorted(PATHS))
def path(request: pytest.FixtureRequest, g1_arms: ArmKinematics) -> ScriptedPath:
    return ScriptedPath(request.param, g1_arms)


def test_moves_smoothly(path: ScriptedPath) -> None:
    poses = sampled(path, 25.0)
    for before, after in pairwise(poses):
        for T_before, T_after in zip(before, after, strict=True):
            distance, angle = difference(T_before, T_after)
            assert distance / CONTROL_PERIOD < MAX_SPEED
            assert angle / CONTROL_PERIOD < MAX_TURN


def test_moves_at_all(path: ScriptedPath) -> None:
    left = np.array([pair[0][:3, 3] for pair in sampled(path, 25.0)])
    assert np.ptp(left, axis=0).max() > 0.08


def test_starts_at_rest(path: ScriptedPath) -> None:
    for T_begin, T_next in zip(path.poses(0.0), path.poses(CONTROL_PERIOD), strict=True):
        assert difference(T_begin, T_next)[0] / CONTROL_PERIOD < 0.02


def test_stays_within_reach_and_before_the_body(path: ScriptedPath, g1_arms: ArmKinematics) -> None:
    for pair in sampled(path, 25.0):
        for arm, T in enumerate(pair):
            position = T[:3, 3]
            assert np.linalg.norm(position - g1_arms.shoulders[arm]) < 0.95 * g1_arms.reach[arm]
            assert position[0] > 0.15


def test_sides_are_mirrored(path: ScriptedPath) -> None:
    mirror = np.diag([1.0, -1.0, 1.0])
    for left, right in sampled(path, 8.0):
        # The two arms of the G1 differ by a hundredth of a millimetre, and their reach by sampling.
        np.testing.assert_allclose(mirror @ left[:3, 3], right[:3, 3], atol=0.01)
        np.testing.assert_allclose(mirror @ left[:3, :3] @ mirror, right[:3, :3], atol=1e-12)


def test_goes_on_for_ever(path: ScriptedPath) -> None:
    assert path.length is None
    assert Approach(path, path.poses(0.0)).length is None


def test_the_service_can_follow(path: ScriptedPath, g1: RobotDescription, service_process) -> None:
    """From home, tick by tick: every answer is on target and clear, and no joint jumps."""
    robot = SimRobot(g1)
    source = Approach(path, robot.wrists())
    q = robot.read().q
    with IKClient(service_process.tcp_url, timeout=5.0) as client:
        margin = client.info().margin
        for i in range(round(12.0 / CONTROL_PERIOD)):
            reply = client.solve(*source.poses(i * CONTROL_PERIOD), q)
            assert reply.status == "ok", f"at {i * CONTROL_PERIOD:.2f} s"
            assert reply.sol_q is not None
            assert reply.position_error is not None
            assert reply.clearance is not None
            assert reply.position_error.max() < 5e-4, f"at {i * CONTROL_PERIOD:.2f} s"
            assert reply.clearance >= margin
            assert np.abs(reply.sol_q - q).max() < MAX_STEP
            q = reply.sol_q


def test_the_first_target_is_where_the_wrists_are(path: ScriptedPath, g1: RobotDescription) -> None:
    wrists = SimRobot(g1).wrists()
    np.testing.assert_array_equal(Approach(path, wrists).poses(0.0), wrists)


def test_the_approach_joins_the_path_without_a_step(path: ScriptedPath, g1: RobotDescription) -> None:
    source = Approach(path, SimRobot(g1).wrists())
    ticks = round((APPROACH_TIME + 2.0) / CONTROL_PERIOD)
    targets = [source.poses(i * CONTROL_PERIOD) for i in range(ticks)]
    for before, after in pairwise(targets):
        for T_before, T_after in zip(before, after, strict=True):
            assert difference(T_before, T_after)[0] / CONTROL_PERIOD < MAX_SPEED
    np.testing.assert_allclose(targets[-1][0], path.poses((ticks - 1) * CONTROL_PERIOD - APPROACH_TIME)[0], atol=1e-9)


def test_an_unknown_path_lists_the_known(g1_arms: ArmKinematics) -> None:
    with pytest.raises(ValueError, match=r"no path 'spiral'; there are circles, reach, wave"):
        ScriptedPath("spiral", g1_arms)
    assert DEFAULT_PATH in PATHS


def test_markers_are_targets_where_they_are_dragged(g1: RobotDescription, g1_arms: ArmKinematics) -> None:
    robot = SimRobot(g1)
    source = Markers(robot)
    dragged = g1_arms.wrists(np.full(14, 0.2))
    robot.show_targets(*dragged)
    np.testing.assert_allclose(source.poses(1.0), dragged, atol=1e-12)
