"""The workloads of the benchmarks that others do not already pin."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.clips import clips
from benchmarks.workloads import PERIOD, crossing
from ik_proto.robots import load_description
from ik_service.robot import Robot


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load(load_description("g1"))


def test_crossing_hands_mirror_each_other_and_meet(robot: Robot) -> None:
    workload = crossing(robot)
    left, right = workload.left[:, :3, 3], workload.right[:, :3, 3]
    assert len(workload) >= 300
    np.testing.assert_allclose(right, left * (1.0, -1.0, 1.0), atol=1e-4)
    assert left[:, 1].max() > 0.15
    assert left[:, 1].min() < -0.12
    assert np.linalg.norm(left - right, axis=1).min() < 0.005
    speed = np.linalg.norm(np.diff(left, axis=0), axis=1) / PERIOD
    assert speed.max() < 0.5


def test_clips_are_resampled_and_clipped(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(11) / 10.0
    names = ["waist_yaw_joint", *reversed(robot.joint_names)]  # another order, and more than the arms
    q = np.zeros((11, len(names)))
    place = names.index("left_elbow_joint")
    q[:, place] = t  # a straight line, which linear interpolation follows exactly
    q[:, names.index("left_shoulder_roll_joint")] = 100.0
    (tmp_path / "motions").mkdir()
    np.savez(tmp_path / "motions" / "line.npz", q=q, joint_names=names, fps=10.0)
    np.savez(tmp_path / "motions" / "other.npz", q=q, joint_names=[f"j{i}" for i in range(len(names))], fps=10.0)
    monkeypatch.setenv("IK_DATA", str(tmp_path))

    (clip,) = clips(robot)
    assert clip.name == "line"
    assert len(clip) == 50
    expected = np.zeros((50, robot.nq))
    expected[:, robot.joint_names.index("left_elbow_joint")] = np.arange(50) * PERIOD
    roll = robot.joint_names.index("left_shoulder_roll_joint")
    expected[:, roll] = robot.upper[roll]
    np.testing.assert_allclose(clip.first, expected[0], atol=1e-12)
    for left, right, row in zip(clip.left, clip.right, expected, strict=True):
        for wrist, target in zip(robot.fk(row), (left, right), strict=True):
            np.testing.assert_allclose(wrist, target, atol=1e-9)


def test_without_recordings_there_are_no_clips(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IK_DATA", str(tmp_path / "nowhere"))
    assert clips(robot) == []
