"""The comparison with other libraries, kept alive with the rows that need no environment of their own."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from benchmarks import compare_peers
from benchmarks.compare_peers import main
from benchmarks.peers import describe, driver
from benchmarks.peers.driver import Comparison, Run, compare
from benchmarks.peers.markdown import BEGIN, END, fill
from benchmarks.peers.metrics import summary
from benchmarks.peers.model import WRISTS, Model, quaternion
from benchmarks.peers.roster import OURS, REFERENCE, ROWS, Row
from benchmarks.workloads import Workload, cold, tracking
from ik_proto.robots import RobotDescription, load_description
from ik_service.preset import Preset
from ik_service.reference import Reference
from ik_service.robot import Robot


def quiet(what: str, solved: int) -> None:
    """Nobody watches the progress of a test."""


@pytest.fixture(scope="module")
def description() -> RobotDescription:
    return load_description("g1")


@pytest.fixture(scope="module")
def robot(description: RobotDescription) -> Robot:
    return Robot.load(description)


@pytest.fixture(scope="module")
def suite(robot: Robot) -> dict[str, list[Workload]]:
    return {"tracking": [tracking(robot, 11)], "cold": [cold(robot, 3)]}


@pytest.fixture(scope="module")
def comparison(
    description: RobotDescription, robot: Robot, suite: dict[str, list[Workload]], tmp_path_factory: Any
) -> Iterator[Comparison]:
    unknown = Row("unknown group", "x", "ours", {}, "", group="no-such-group")
    broken = Row("unknown solver", "x", "no_such_solver", {}, "")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(driver, "BLOCK", 4)  # several turns in a few frames
        rows = (*OURS, REFERENCE, unknown, broken)
        yield compare(description, robot, suite, rows, tmp_path_factory.mktemp("peers"), quiet)


def beginning(workload: Workload, frames: int) -> Workload:
    return replace(workload, left=workload.left[:frames], right=workload.right[:frames])


def run_of(comparison: Comparison, row: Row, name: str) -> Run:
    (one,) = (one for one in comparison.contestants if one.row is row)
    return one.runs[name]


@pytest.mark.parametrize("name", ["tracking", "cold"])
def test_turns_lead_along_the_same_path_as_no_turns(
    comparison: Comparison,
    suite: dict[str, list[Workload]],
    description: RobotDescription,
    robot: Robot,
    name: str,
) -> None:
    reference = Reference(robot, Preset.of(description, "openwbt"))
    (workload,) = suite[name]
    q, expected = workload.first, []
    for k in range(len(workload)):
        q = reference.solve(workload.left[k], workload.right[k], workload.start(k, q))[0]
        expected.append(q)
    (answers,) = run_of(comparison, REFERENCE, name).answers
    np.testing.assert_allclose(answers, expected, atol=1e-9)


def test_every_frame_is_timed_once(comparison: Comparison) -> None:
    for one in comparison.contestants:
        assert [len(block) for block in one.runs["tracking"].times] == [4, 4, 3]
        assert [len(block) for block in one.runs["cold"].times] == [3]


@pytest.mark.parametrize("row", OURS, ids=lambda row: row.name)
def test_our_rows_are_measured(
    comparison: Comparison, suite: dict[str, list[Workload]], robot: Robot, row: Row
) -> None:
    assert row.name not in comparison.absent
    numbers = summary(robot, suite["tracking"], run_of(comparison, row, "tracking"), None)
    assert numbers["raised"] == numbers["limit_violations"] == 0
    if "precise" in row.name and "avoid" not in row.name:
        assert numbers["success_percent"] == 100.0


def test_a_row_that_cannot_be_had_is_named_with_the_reason(comparison: Comparison) -> None:
    assert comparison.absent["unknown group"].startswith("not installed: ")
    assert "no_such_solver" in comparison.absent["unknown solver"]
    assert set(comparison.absent) == {"unknown group", "unknown solver"}


def test_a_row_with_other_kinematics_is_not_measured(
    description: RobotDescription, suite: dict[str, list[Workload]], tmp_path: Path
) -> None:
    left, right = description.arms
    x, y, z = left.wrist.xyz
    other = replace(left, wrist=replace(left.wrist, xyz=(x + 1e-5, y, z)))
    robot = Robot.load(replace(description, arms=(other, right)))
    result = compare(description, robot, suite, (REFERENCE,), tmp_path, quiet)
    assert result.contestants == []
    assert "forward kinematics differs from ours by" in result.absent[REFERENCE.name]


def test_both_model_files_move_like_the_robot(description: RobotDescription, robot: Robot, tmp_path: Path) -> None:
    describe.write(tmp_path, description, robot)
    model = Model.read(tmp_path)
    urdf = pin.buildModelFromUrdf(str(model.urdf))
    mjcf = mujoco.MjModel.from_xml_path(str(model.mjcf))
    pin_data, mj_data = urdf.createData(), mujoco.MjData(mjcf)
    np.testing.assert_array_equal(urdf.lowerPositionLimit, robot.lower)
    np.testing.assert_array_equal(mjcf.jnt_range, np.column_stack([robot.lower, robot.upper]))
    for q in np.random.default_rng(1).uniform(robot.lower, robot.upper, (20, robot.nq)):
        pin.framesForwardKinematics(urdf, pin_data, q)
        mj_data.qpos[:] = q
        mujoco.mj_kinematics(mjcf, mj_data)
        for name, wrist in zip(WRISTS, robot.fk(q), strict=True):
            np.testing.assert_allclose(pin_data.oMf[urdf.getFrameId(name)].homogeneous, wrist, atol=1e-12)
            site = mj_data.site(name)
            np.testing.assert_allclose(site.xpos, wrist[:3, 3], atol=1e-12)
            np.testing.assert_allclose(site.xmat.reshape(3, 3), wrist[:3, :3], atol=1e-12)


def test_quaternions_are_pinocchios() -> None:
    rng = np.random.default_rng(2)
    for _ in range(200):
        R = pin.exp3(np.pi * rng.normal(size=3))
        x, y, z, w = pin.Quaternion(R).coeffs()
        ours = quaternion(R)
        np.testing.assert_allclose(ours * np.sign(ours @ (w, x, y, z)), (w, x, y, z), atol=1e-12)


def test_metrics_count_what_is_wrong_with_a_path(robot: Robot) -> None:
    workload = tracking(robot, 10)
    path = np.repeat(workload.first[None], 10, axis=0)
    targets = [robot.fk(q) for q in path]
    left, right = (np.array(side) for side in zip(*targets, strict=True))
    held = replace(workload, left=left, right=right)
    good = summary(robot, [held], Run([path], [[1.0] * 10]), Run([path], [[2.0] * 10]))
    assert good["success_percent"] == 100.0
    assert good["ratio"] == 0.5
    assert good["torn_frames"] == good["limit_violations"] == 0

    torn = path.copy()
    torn[5, 3] += 0.4
    torn[7, 0] = robot.upper[0] + 0.01
    bad = summary(robot, [held], Run([torn], [[1.0] * 10]), None)
    assert bad["success_percent"] == pytest.approx(80.0)
    assert bad["limit_violations"] == 1
    assert bad["largest_violation_rad"] == pytest.approx(0.01)
    assert bad["torn_frames"] == 4  # there and back, twice
    assert bad["step_rad"]["max"] >= 0.4


def test_the_command_writes_all_numbers(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A few frames of each workload; the command as documented is run by the documentation's tests."""
    usual = compare_peers.suite(robot, quick=True)
    few = {name: [beginning(workload, 5) for workload in group] for name, group in usual.items()}
    monkeypatch.setattr(compare_peers, "suite", lambda *_: few)
    saved = tmp_path / "numbers.json"
    assert main(["--quick", "--peers", "reference", "--json", str(saved)]) == 0
    assert REFERENCE.name in capsys.readouterr().out
    numbers = json.loads(saved.read_text())
    assert {"tracking", "crossing", "unreachable", "cold"} <= set(numbers["results"])
    assert numbers["rows"][REFERENCE.name]["fk_difference"] < 1e-9
    page = fill(f"before\n{BEGIN}\nnumbers of yesterday\n{END}\nafter\n", numbers)
    assert "yesterday" not in page
    assert page.count(f"| {REFERENCE.name} |") == len(numbers["results"])


def test_an_unknown_peer_is_a_one_line_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--peers", "nobody"])
    assert stop.value.code == 2
    assert "no peer 'nobody'; there are ours, reference, pink" in capsys.readouterr().err


def test_a_page_without_marks_is_refused() -> None:
    with pytest.raises(ValueError, match="marks"):
        fill("a page", {"environment": {}})


def test_rows_have_names_of_their_own() -> None:
    assert len({row.name for row in ROWS}) == len(ROWS)
