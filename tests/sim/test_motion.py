"""Motion files: wrist targets from recorded joints, and files that cannot be played."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ik_proto import Array
from sim_client.arms import ArmKinematics
from sim_client.motion import MotionError, RecordedMotion

FPS = 50.0
FRAMES = 20


@pytest.fixture
def recorded(g1_arms: ArmKinematics) -> Array:
    """Smooth arm joints within their limits, shape (FRAMES, 14) [rad]."""
    phase = np.linspace(0.0, 2.0, FRAMES)[:, None] + np.arange(14)
    middle, half = (g1_arms.upper + g1_arms.lower) / 2.0, (g1_arms.upper - g1_arms.lower) / 2.0
    return middle + 0.5 * half * np.sin(phase)


def saved(path: Path, **fields: Any) -> Path:
    np.savez(path, **fields)
    return path


def test_targets_are_the_wrists_of_the_recorded_arms(tmp_path: Path, recorded: Array, g1_arms: ArmKinematics) -> None:
    file = saved(tmp_path / "m.npz", q=recorded, fps=FPS, joint_names=list(g1_arms.joint_names))
    motion = RecordedMotion(file, g1_arms)
    assert motion.length == pytest.approx((FRAMES - 1) / FPS)
    assert motion.clipped == 0.0
    for frame in (0, 7, FRAMES - 1):
        for T, expected in zip(motion.poses(frame / FPS), g1_arms.wrists(recorded[frame]), strict=True):
            np.testing.assert_allclose(T, expected, atol=1e-6)


def test_columns_are_found_by_name_and_others_ignored(tmp_path: Path, recorded: Array, g1_arms: ArmKinematics) -> None:
    names = list(g1_arms.joint_names)
    plain = RecordedMotion(saved(tmp_path / "a.npz", q=recorded, fps=FPS, joint_names=names), g1_arms)
    whole = np.hstack([np.full((FRAMES, 1), 9.0), recorded[:, ::-1]])
    mixed = saved(tmp_path / "b.npz", q=whole, fps=FPS, joint_names=["waist_yaw_joint", *names[::-1]])
    np.testing.assert_array_equal(RecordedMotion(mixed, g1_arms).q, plain.q)


def test_between_frames_the_targets_are_between(tmp_path: Path, recorded: Array, g1_arms: ArmKinematics) -> None:
    file = saved(tmp_path / "m.npz", q=recorded, fps=FPS, joint_names=list(g1_arms.joint_names))
    motion = RecordedMotion(file, g1_arms)
    before, middle, after = (motion.poses(t / FPS)[0] for t in (3.0, 3.5, 4.0))
    np.testing.assert_allclose(middle[:3, 3], (before[:3, 3] + after[:3, 3]) / 2.0, atol=1e-9)


def test_after_the_end_it_stands_still(tmp_path: Path, recorded: Array, g1_arms: ArmKinematics) -> None:
    file = saved(tmp_path / "m.npz", q=recorded, fps=FPS, joint_names=list(g1_arms.joint_names))
    motion = RecordedMotion(file, g1_arms)
    np.testing.assert_array_equal(motion.poses(100.0)[1], motion.poses(motion.length)[1])


def test_a_single_frame_is_a_posture(tmp_path: Path, recorded: Array, g1_arms: ArmKinematics) -> None:
    file = saved(tmp_path / "m.npz", q=recorded[:1], fps=FPS, joint_names=list(g1_arms.joint_names))
    motion = RecordedMotion(file, g1_arms)
    assert motion.length == 0.0
    np.testing.assert_array_equal(motion.poses(0.0)[0], motion.poses(3.0)[0])


def test_joints_are_cut_to_their_limits(tmp_path: Path, recorded: Array, g1_arms: ArmKinematics) -> None:
    recorded[4, 3] = 9.0
    file = saved(tmp_path / "m.npz", q=recorded, fps=FPS, joint_names=list(g1_arms.joint_names))
    motion = RecordedMotion(file, g1_arms)
    assert motion.q[4, 3] == g1_arms.upper[3]
    assert motion.clipped == pytest.approx(1.0 / recorded.size)


def wrong(g1_arms: ArmKinematics, **changes: Any) -> dict[str, Any]:
    fields = {"q": np.zeros((5, 14)), "fps": FPS, "joint_names": list(g1_arms.joint_names)} | changes
    return {name: value for name, value in fields.items() if value is not None}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"q": None}, "has no 'q'"),
        ({"fps": None}, "has no 'fps'"),
        ({"joint_names": None}, "has no 'joint_names'"),
        ({"q": np.zeros((5, 13))}, r"shape \(5, 13\); it must be \(frames, 14\)"),
        ({"q": np.zeros(14)}, "shape"),
        ({"q": np.zeros((0, 14))}, "shape"),
        ({"q": np.full((5, 14), "a")}, "shape"),
        ({"q": np.where(np.arange(70).reshape(5, 14) == 30, np.nan, 0.0)}, "not finite in frame 2"),
        ({"fps": 0.0}, "fps must be one positive number"),
        ({"fps": np.nan}, "fps must be one positive number"),
        ({"fps": [50.0, 50.0]}, "fps must be one positive number"),
        ({"fps": "fast"}, "fps must be one positive number"),
        ({"joint_names": [f"joint_{i}" for i in range(14)]}, "has no joint left_shoulder_pitch_joint"),
        ({"joint_names": np.array([{}] * 14, dtype=object)}, "Python objects"),
    ],
)
def test_files_that_cannot_be_played(
    tmp_path: Path, g1_arms: ArmKinematics, changes: dict[str, Any], message: str
) -> None:
    file = saved(tmp_path / "wrong.npz", **wrong(g1_arms, **changes))
    with pytest.raises(MotionError, match=message) as error:
        RecordedMotion(file, g1_arms)
    assert str(error.value).startswith(f"{file}: ")
    assert "\n" not in str(error.value)


def test_files_that_are_something_else(tmp_path: Path, g1_arms: ArmKinematics) -> None:
    text, array, truncated, pickled = (tmp_path / name for name in ("a.npz", "b.npy", "c.npz", "d.npz"))
    text.write_text("hello")
    np.save(array, np.zeros(3))
    saved(truncated, **wrong(g1_arms))
    truncated.write_bytes(truncated.read_bytes()[:200])
    pickled.write_bytes(pickle.dumps({"q": 1}))
    for file in (text, array, truncated, pickled, tmp_path / "absent.npz", tmp_path):
        with pytest.raises(MotionError) as error:
            RecordedMotion(file, g1_arms)
        assert str(error.value).startswith(f"{file}: ")
        assert "\n" not in str(error.value)


def test_recorded_clips_can_be_played(shared_data: Path, g1_arms: ArmKinematics) -> None:
    files = sorted((shared_data / "motions").glob("*.npz"))
    assert files
    for file in files:
        motion = RecordedMotion(file, g1_arms)
        assert motion.length > 1.0
        assert motion.clipped < 0.2, file.name
