"""The benchmark of what the solver reaches: a few frames of each measurement, and that a broken solver fails it."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

from benchmarks import solver_limits
from benchmarks.limits import batch, beyond, pairs, precision, reach, requests, safety, tracking
from benchmarks.limits.geometry import SelfDistances, segment_distances, wrist_errors, wrists
from benchmarks.limits.page import BEGIN, END, fill
from benchmarks.limits.paths import clear_path, clear_postures, random_path, recorded, runs
from benchmarks.limits.requests import HAND_SPEED, Adversary
from benchmarks.limits.rig import Result, Rig, Sizes
from benchmarks.self_clearance import self_clearance
from benchmarks.workloads import PERIOD
from ik_service.robot import Robot
from ik_service.solution import BatchSolution, Solution
from ik_service.solver import Solver

FRAMES = 20
TINY = Sizes(
    frames=FRAMES,
    paths=1,
    targets=4,
    budget_targets=2,
    requests=80,
    walked=40,
    rounds=1,
    batches=(1, 8),
    batch_seconds=0.0,
    pair_points=2,
)


def quiet(done: int, total: int) -> None:
    """Hear of progress and say nothing."""


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig.build("g1", TINY)


@pytest.fixture(scope="module")
def robot(rig: Rig) -> Robot:
    return rig.robot


@pytest.fixture(autouse=True)
def recording(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One short recording, whose first three frames are beyond a limit."""
    q = random_path(robot, FRAMES, 1, share=0.3).q.copy()
    q[:, 0] = robot.upper[0] + 0.025 - 0.01 * np.arange(FRAMES)
    (tmp_path / "motions").mkdir()
    np.savez(tmp_path / "motions" / "wave.npz", q=q, joint_names=list(robot.joint_names), fps=25.0)
    monkeypatch.setenv("IK_DATA", str(tmp_path))


@pytest.fixture(autouse=True)
def short_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    """Adversarial paths of a few frames."""
    for module in (requests, safety):
        monkeypatch.setattr(module, "PATH_FRAMES", 4)


def postures(robot: Robot, count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(robot.lower, robot.upper, (count, robot.nq))


def failed(result: Result) -> list[str]:
    return [row.what for row in result.rows if row.failed]


def spoilt(rig: Rig, spoil: Callable[[np.ndarray, int], np.ndarray]) -> Rig:
    """The rig with a solver whose answers are altered: given q and the number of the call."""

    class Spoilt(Solver):
        calls = 0

        def solve(self, *args: Any, **options: Any) -> Solution:
            answer = super().solve(*args, **options)
            self.calls += 1
            answer.q = spoil(answer.q, self.calls)
            return answer

        def solve_batch(self, *args: Any, **options: Any) -> BatchSolution:
            answers = super().solve_batch(*args, **options)
            answers.q = np.array([spoil(q, k) for k, q in enumerate(answers.q)])
            return answers

    return replace(rig, precise=Spoilt(rig.robot, rig.kernel, rig.precise.preset))


class Blind(Solver):
    """Looks for no collisions, whatever it is told, and reports no clearance that gives it away."""

    def solve(self, *args: Any, **options: Any) -> Solution:
        options["collision"] = "report"
        return super().solve(*args, **options)

    def solve_batch(self, *args: Any, **options: Any) -> BatchSolution:
        options["collision"] = "report"
        return super().solve_batch(*args, **options)


# The measure: distances and poses.


@pytest.mark.parametrize("degenerate", ["", "parallel", "points", "crossing"])
def test_segment_distances_are_those_of_coal(degenerate: str) -> None:
    rng = np.random.default_rng(3)
    a0, a1, b0, b1 = rng.uniform(-1.0, 1.0, (4, 200, 3))
    if degenerate == "parallel":
        b1 = b0 + rng.uniform(-2.0, 2.0, (200, 1)) * (a1 - a0)
    elif degenerate == "points":
        a1 = a0.copy()
    elif degenerate == "crossing":
        b1 = b0 + 2.0 * (0.5 * (a0 + a1) - b0)
    found = segment_distances(a0, a1, b0, b1)
    radius = 1e-3
    for k in range(200):
        shapes, poses = zip(*(_capsule(*ends, radius) for ends in ((a0[k], a1[k]), (b0[k], b1[k]))), strict=True)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        apart = coal.distance(shapes[0], poses[0], shapes[1], poses[1], request, result) + 2.0 * radius
        assert found[k] == pytest.approx(apart, abs=1e-6)
    np.testing.assert_allclose(segment_distances(b1, b0, a0, a1), found, atol=1e-12)


def _capsule(start: np.ndarray, end: np.ndarray, radius: float) -> tuple[Any, Any]:
    along = end - start
    length = float(np.linalg.norm(along))
    z = along / length if length else np.array([0.0, 0.0, 1.0])
    R = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z).toRotationMatrix()
    return coal.Capsule(radius, length), coal.Transform3s(R, 0.5 * (start + end))


def test_clearance_agrees_with_the_solvers_own_expressions(rig: Rig) -> None:
    q = postures(rig.robot, 200)
    own = self_clearance(rig.robot)
    assert own is not None
    np.testing.assert_allclose(rig.distances.clearance(q), own(q), atol=1e-12)


def test_poses_and_errors_are_those_of_pinocchio(robot: Robot) -> None:
    q = postures(robot, 20)
    waist = np.random.default_rng(1).uniform(-0.5, 0.5, (20, 3))
    bent = np.array([robot.waist.motion(row) for row in waist])
    for k, pair in enumerate(zip(*wrists(robot, q, bent), strict=True)):
        for mine, its in zip(pair, robot.fk(q[k], waist[k]), strict=True):
            np.testing.assert_allclose(mine, its, atol=1e-12)
    left, right = wrists(robot, q)
    near = q + np.random.default_rng(2).normal(0.0, 1e-3, q.shape)
    position, rotation = wrist_errors(robot, near, left, right)
    for k in range(20):
        distances, angles = robot.wrist_errors(near[k], left[k], right[k])
        assert position[k] == pytest.approx(distances.max(), abs=1e-12)
        assert rotation[k] == pytest.approx(angles.max(), abs=1e-9)


def test_a_bent_waist_moves_what_stays_on_the_base(rig: Rig) -> None:
    model, waist = rig.robot.collision, np.array([0.4, -0.2, 0.3])
    T = rig.robot.waist.motion(waist)
    ends = rig.distances.ends(postures(rig.robot, 1), T[None])[0]
    base = [place for place, capsule in enumerate(model.capsules) if capsule.carrier.value == "base"]
    np.testing.assert_allclose(ends[base], model.base_ends(T), atol=1e-12)


# Paths and requests.


def test_paths_keep_what_they_promise(rig: Rig) -> None:
    robot = rig.robot
    middle, half = (robot.lower + robot.upper) / 2.0, (robot.upper - robot.lower) / 2.0
    assert (np.abs(random_path(robot, 300, 2).q - middle) <= 0.95 * half + 1e-12).all()
    path = clear_path(robot, rig.distances, 100, 2)
    assert (rig.distances.clearance(path.q) >= robot.collision.margin).all()
    assert np.ptp(path.q, axis=0).max() > 0.1
    (clip,) = recorded(robot)
    assert (clip.fps, len(clip)) == (25.0, FRAMES)
    assert clip.inside.tolist() == [False] * 3 + [True] * (FRAMES - 3)
    assert [(run.start, run.stop) for run in runs(np.array([True, False, False, True, True]))] == [(0, 1), (3, 5)]


def test_adversaries_aim_at_the_body(rig: Rig) -> None:
    robot, distances = rig.robot, rig.distances
    adversary = Adversary(robot, distances, np.random.default_rng(4), 20)
    for family in adversary.families:
        jumps = adversary.jumps(family, 10)
        assert (distances.clearance(jumps.q) >= robot.collision.margin).all()
        frames = list(adversary.path(family, 5))
        poses = np.array([wrists(robot, frames[0].q)[0], *(frame.left for frame in frames)])
        speed = np.linalg.norm(np.diff(poses[:, :, :3, 3], axis=0), axis=2) / PERIOD
        assert speed.max() == pytest.approx(HAND_SPEED)
        for T in poses.reshape(-1, 4, 4):
            np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9)
    torso = adversary.jumps("hands into torso", 50)
    x, y, z = torso.left[:, :3, 3].T
    assert (np.abs(x) < 0.1).all()
    assert (np.abs(y) < 0.15).all()
    assert ((z > 0.0) & (z < 0.4)).all()
    crossing = adversary.jumps("arms crossing", 50)
    assert (crossing.left[:, 1, 3] < 0.0).all()
    assert (crossing.right[:, 1, 3] > 0.0).all()
    random = adversary.random(50, bent=True)
    assert random.waist is not None
    share = (distances.clearance(random.q) >= robot.collision.margin).mean()
    assert 0.5 <= share < 1.0


def test_clear_postures_are_clear(rig: Rig) -> None:
    q = clear_postures(rig.robot, rig.distances, 30, np.random.default_rng(5))
    assert q.shape == (30, rig.robot.nq)
    assert (rig.distances.clearance(q) >= rig.robot.collision.margin).all()


# The measurements.


@pytest.mark.parametrize("measurement", [precision, beyond, reach, tracking, safety, batch, pairs])
def test_every_measurement_works(rig: Rig, measurement: Any) -> None:
    heard: list[tuple[int, int]] = []
    if measurement is pairs:  # or it would compile a kernel for each number of pairs
        rig = Rig.build("g1", TINY, compiled=False)
    result = measurement.measure(rig, lambda done, total: heard.append((done, total)))
    assert heard
    assert heard[-1][0] == heard[-1][1]
    assert result.rows
    assert all(row.met is not None for row in result.rows if row.judged)
    json.dumps(result.numbers)


def test_requests_are_counted_once_and_paths_walked(rig: Rig) -> None:
    result = safety.measure(rig, quiet)
    families = result.numbers["families"]
    assert sum(numbers["requests"] for numbers in families.values()) == rig.sizes.requests + FRAMES
    assert sum(numbers["walked"] for numbers in families.values()) == pytest.approx(rig.sizes.walked, abs=5)
    assert sum(numbers["contact"] for numbers in families.values()) == 0
    assert not failed(result)


def test_an_inexact_solver_fails_precision(rig: Rig) -> None:
    assert not [what for what in failed(precision.measure(rig, quiet)) if "off" in what and "jerk" not in what]
    loose = spoilt(rig, lambda q, _: q + 2e-3)
    failures = failed(precision.measure(loose, quiet))
    for group in ("recorded", "random", "clear"):
        assert any(what.startswith(f"{group}, off") and "position" in what for what in failures)


def test_a_flipping_solver_fails_precision(rig: Rig) -> None:
    flipping = spoilt(rig, lambda q, call: q + 0.5 * (call % 7 == 6) * np.eye(rig.robot.nq)[3])
    assert "random, off: flips" in failed(precision.measure(flipping, quiet))


def test_a_chattering_solver_fails_beyond_reach(rig: Rig) -> None:
    # With avoidance the solver misses its bar here, see docs/benchmarks.md.
    assert not [what for what in failed(beyond.measure(rig, quiet)) if what.startswith("unreachable, off")]
    chattering = spoilt(rig, lambda q, call: q + 0.03 * (-1.0) ** call)
    failures = failed(beyond.measure(chattering, quiet))
    for setting in ("off", "avoid"):
        assert f"unreachable, {setting}: largest joint step a frame" in failures


def test_a_solver_that_ends_beside_the_target_fails_reach(rig: Rig) -> None:
    assert not failed(reach.measure(rig, quiet))
    near = spoilt(rig, lambda q, _: q + 1e-3)
    assert any("within" in what for what in failed(reach.measure(near, quiet)))


def test_a_solver_blind_to_collisions_fails_safety(rig: Rig) -> None:
    blind = replace(rig, precise=Blind(rig.robot, rig.kernel, rig.precise.preset))
    result = safety.measure(blind, quiet)
    failures = failed(result)
    assert any("smallest clearance" in what for what in failures)
    assert "answers with a pair nearer than margin and start" in failures
    assert any("with a new contact" in what for what in failures)
    jumps = result.numbers["families"]["hands into torso, jump"]
    assert jumps["broken"] > 0
    assert {"q", "left", "right", "waist", "answer"} < set(jumps["cases"][0])


def test_a_solver_a_hair_beyond_its_limits_fails_safety(rig: Rig) -> None:
    nudged = spoilt(rig, lambda q, _: np.where(q == rig.robot.upper, np.nextafter(q, 9.0), q) + 1e-7)
    failures = failed(safety.measure(nudged, quiet))
    assert "answers beyond a joint limit" in failures
    assert "error of the reported clearance" in failures


def test_a_pair_below_the_margin_may_stay_but_not_close(rig: Rig) -> None:
    q = postures(rig.robot, 300)
    q = q[rig.distances.clearance(q) < rig.robot.collision.margin]
    targets = wrists(rig.robot, q)
    broken = []
    for step in (0.0, 1e-6, -1e-6):
        answers = rig.precise.solve_batch(*targets, q, collision="report")
        answers.q = q + step
        tally = safety.Tally()
        safety.audit(rig, tally, requests.Requests("held", *targets, q), answers)
        broken.append(tally.broken)
        assert tally.started_below == len(q)
    assert broken[0] == 0
    assert sum(broken) >= len(q)  # one way or the other, the nearest pair closes


def test_thinned_models_stay_in_order(robot: Robot) -> None:
    model = robot.collision
    kept = [0, 3, model.right[0], model.across[0], model.across[-1]]
    thin = pairs.thinned(model, kept)
    assert thin.pairs == tuple(model.pairs[place] for place in kept)
    assert (thin.left, thin.right, thin.across) == (range(2), range(2, 3), range(3, 5))
    assert pairs.thinned(model, []).pairs == ()
    robot_thin = robot.copy()
    robot_thin.collision = thin
    q = postures(robot, 10)
    np.testing.assert_array_equal(SelfDistances(robot_thin).pairs(q), SelfDistances(robot).pairs(q)[:, kept])


# The command.


def test_the_command_saves_numbers_and_its_exit_code_tells(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    saved = tmp_path / "numbers.json"
    monkeypatch.setattr(solver_limits.Rig, "build", lambda *_: rig)
    assert solver_limits.main(["--quick", "--only", "reach,batch", "--json", str(saved)]) == 0
    assert "99.99 %" in capsys.readouterr().out
    numbers = json.loads(saved.read_text())
    assert list(numbers["results"]) == ["reach", "batch"]
    page = fill(f"before\n{BEGIN}\nnumbers of yesterday\n{END}\nafter\n", numbers)
    assert "yesterday" not in page
    assert page.count("99.99 %") == 1
    with pytest.raises(ValueError, match="marks"):
        fill("a page", numbers)

    monkeypatch.setattr(solver_limits.Rig, "build", lambda *_: spoilt(rig, lambda q, _: q + 1e-3))
    assert solver_limits.main(["--quick", "--only", "reach"]) == 1
    assert "missed: reach" in capsys.readouterr().out


def test_an_unknown_measurement_is_a_one_line_mistake(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        solver_limits.main(["--only", "nothing"])
    assert stop.value.code == 2
    assert "no measurement 'nothing'; there are precision, beyond" in capsys.readouterr().err
