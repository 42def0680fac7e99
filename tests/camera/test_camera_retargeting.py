"""Recorded motion of people on the robot: wrist basis, way out of its body, inverse kinematics with elbows, limiter.

Of what the solver answers it is only asked that it is within the limits: people move faster than the robot may, and
their hands pass where the robot's body is. Of what is commanded everything is, and that it is clear of the body.
"""

from pathlib import Path

import numpy as np
import pytest
from human_motion import HumanMotion, human_motions
from missed import Cause
from retargeting import ELBOW_LIKE, RATE, Replay, Retargeting

from ik_client.clear_way import KEPT
from ik_client.joint_limiter import MotionLimits
from ik_proto.robots import load_description
from ik_service.kernel import load_kernel
from ik_service.preset import Preset
from ik_service.robot import Robot
from ik_service.solver import Solver

SOME = {
    "climb_1": (0.86, 0.99, 0.99, 0.1),
    "side_jump_level4_filter": (0.55, 0.99, 0.75, 0.2),
    "single_foot_balance_level3_filter": (0.55, 0.99, 0.99, 0.2),
    "squat_level3_filter": (0.55, 0.99, 0.99, 0.2),
    "step_forward_forward_level2_filter": (0.18, 0.99, 0.99, 0.2),
    "walk_level1_filter": (0.42, 0.99, 0.97, 0.4),
    "kick_level3_filter": (0.24, 0.97, 0.95, 0.4),
    "Bolt_level1": (0.55, 0.88, 0.7, 2.0),
}
"""Of some clips, of which share the person's arm is possible at least, of which share of that the elbow is like the
person's, in the answer and in the command, and the largest step of a joint from one answer to the next [rad]. In
the last four hands are at the thighs or before the belly, where the robot's body is, most of the time; the last moves
faster than the robot may."""


@pytest.fixture(scope="module")
def motions(shared_data: Path) -> dict[str, HumanMotion]:
    folder = shared_data / "human"
    if not (folder / "smpl" / "joints_30fps.npz").is_file():
        pytest.skip(f"no recorded people in {folder}")
    return {motion.name: motion for motion in human_motions(folder)}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load(load_description("g1"))


@pytest.fixture(scope="module")
def solver(robot: Robot, kernel_cache: Path) -> Solver:
    return Solver(robot, load_kernel(robot, folder=kernel_cache), Preset.of(load_description("g1"), "precise"))


@pytest.fixture(scope="module")
def retargeting(robot: Robot, solver: Solver) -> Retargeting:
    return Retargeting(robot, solver, load_description("g1"))


def assert_within_bounds(replay: Replay, robot: Robot):
    for q in (replay.wanted, replay.commanded):
        assert (q >= robot.lower).all()
        assert (q <= robot.upper).all()
    assert replay.clearance.min() >= KEPT
    # A jump is a step that the limiter's bounds do not allow.
    bounds = MotionLimits()
    step = np.abs(np.diff(replay.commanded, axis=0, prepend=replay.commanded[:1]))
    assert (step <= np.asarray(bounds.velocity) / RATE + 1e-9).all()
    assert (np.abs(replay.velocity) <= np.asarray(bounds.velocity) + 1e-9).all()
    assert (np.abs(replay.acceleration) <= np.asarray(bounds.acceleration) + 1e-9).all()


@pytest.mark.timeout(300)  # The kernel may have to be compiled first.
@pytest.mark.parametrize("name", SOME)
def test_elbows_are_the_persons_where_they_can_be(
    motions: dict[str, HumanMotion], retargeting: Retargeting, robot: Robot, name: str
):
    replay = retargeting.replay(motions[name].at(RATE, most=9.0))
    assert_within_bounds(replay, robot)
    possible = replay.judged()
    least_possible, least_like, least_done, largest_step = SOME[name]
    assert possible.mean() > least_possible
    assert (replay.elbow_off[possible] <= ELBOW_LIKE).mean() >= least_like
    assert (replay.robot_off[possible] <= ELBOW_LIKE).mean() >= least_done
    missed = possible & (replay.elbow_off > ELBOW_LIKE)
    assert [cause is not None for cause in replay.causes[possible]] == missed[possible].tolist()
    assert np.abs(np.diff(replay.wanted, axis=0)).max() < largest_step


@pytest.mark.timeout(300)
def test_without_a_way_out_an_arm_is_caught_by_the_body(motions: dict[str, HumanMotion], retargeting: Retargeting):
    """The negative control: the solver alone avoids the body too, but not on the person's side of it."""
    replay = retargeting.replay(motions["kick_level3_filter"].at(RATE), kept_clear=False)
    assert (replay.elbow_off[replay.judged()] <= ELBOW_LIKE).mean() < 0.9


@pytest.mark.timeout(300)
def test_arms_are_missed_where_the_robot_is_behind(motions: dict[str, HumanMotion], retargeting: Retargeting):
    """A robot without limits of speed misses nothing of a jump of which this one misses a fifth."""
    limbs = motions["jump_degree_level4_filter"].at(RATE)
    possible = retargeting.possible(limbs)
    replay, unlimited = (
        retargeting.replay(limbs, possible=possible, start=start) for start in ("command", "unlimited")
    )
    judged = replay.judged()
    assert (replay.elbow_off[judged] <= ELBOW_LIKE).mean() < 0.9
    assert (unlimited.elbow_off[judged] <= ELBOW_LIKE).mean() >= 0.99
    assert {Cause.LATE, Cause.OTHER_BEND} >= {cause for cause in replay.causes[judged] if cause}


def test_what_is_possible_is_the_arm_as_the_person_has_it(motions: dict[str, HumanMotion], retargeting: Retargeting):
    limbs = motions["Bolt_level1"].at(RATE, most=1.0)
    possible = retargeting.possible(limbs)
    assert 0.3 < possible.arms.mean() < 0.9
    assert np.array_equal(np.isfinite(possible.q).reshape(-1, 2, 7).all(axis=2), possible.arms)
    for now, q, (left, right) in zip(limbs, possible.q, possible.arms, strict=True):
        upper = retargeting.upper_arms(np.nan_to_num(q))
        off = np.degrees(np.arccos((upper * now[:, 0]).sum(axis=1).clip(-1.0, 1.0)))
        assert (off[[left, right]] < ELBOW_LIKE).all()


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("name", "waist"),
    [
        ("walk_level1_filter", (0.0, 0.0, 0.3)),
        ("side_jump_level1_filter", (0.4, 0.0, 0.0)),
        ("step_forward_forward_level2_filter", (0.0, 0.25, 0.0)),
    ],
)
def test_a_bent_waist_gets_in_nobodys_way(
    motions: dict[str, HumanMotion], robot: Robot, solver: Solver, name: str, waist: tuple[float, ...]
):
    """Yaw, roll and pitch of the waist [rad]; and the negative control, a body that is taken to be upright."""
    bent = Retargeting(robot, solver, load_description("g1"), np.array(waist))
    limbs = motions[name].at(RATE)
    possible = bent.possible(limbs)
    replay = bent.replay(limbs, possible=possible)
    assert_within_bounds(replay, robot)
    judged = replay.judged()
    assert (replay.elbow_off[judged] <= ELBOW_LIKE).mean() >= 0.95
    ignorant = bent.replay(limbs, possible=possible, knows_waist=False)
    assert replay.blocked.mean() < 0.06
    assert ignorant.blocked.mean() > replay.blocked.mean() + 0.05


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_no_clip_takes_the_robot_out_of_its_bounds(
    motions: dict[str, HumanMotion], retargeting: Retargeting, robot: Robot
):
    for motion in motions.values():
        assert_within_bounds(retargeting.replay(motion.at(RATE)), robot)


def test_directions_are_the_persons_own_left_and_right(motions: dict[str, HumanMotion]):
    for motion in motions.values():
        shoulders, elbows = motion.arms[:, :, 0].mean(axis=0), motion.arms[:, :, 1].mean(axis=0)
        assert shoulders[0, 1] > 0.1 > -0.1 > shoulders[1, 1]
        assert (shoulders[:, 2] > 0.25).all()
        # Feet and knees apart, people carry their arms before them more than behind.
        assert (elbows[:, 0] > -0.1).all()
