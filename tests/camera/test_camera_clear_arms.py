"""Forearms kept out of the robot's body: what is clear stays, what is inside comes out, evenly and on its own side."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from looks import look

from camera_client.clear_arms import FOREARM_FROM, ClearArms, segment_distances
from camera_client.robot_arms import robot_geometry
from camera_client.scaling import G1_ARMS, shoulder_positions
from camera_client.tracker import CameraTracker
from camera_client.vectors import length, rotate, unit
from camera_client.wrist_basis import WristBasis
from ik_proto.robots import load_description
from ik_service.collision import Carrier
from ik_service.robot import Robot

DESCRIPTION = load_description("g1")
CLEAR_ARMS = ClearArms(G1_ARMS, DESCRIPTION)
GEOMETRY = robot_geometry(DESCRIPTION)
KEPT = CLEAR_ARMS.kept
ROUNDING = 2e-3
"""Between the points of the grid the clearance is not quite linear [m]."""
TOO_FAR = 5e-3
"""Nor is it turned out exactly as far as is needed [m]."""

seeds = st.integers(0, 2**32 - 1)


def hands_of(limbs):
    """Orientations of hands that are not turned about their forearms."""
    return WristBasis().update(limbs[:, 0], limbs[:, 1], 0.0, np.ones(2))


def near_the_body(rng):
    """Arms as people carry them by the body: upper arms hang, forearms point down, ahead and inwards."""
    upper = np.array([[0.2, 0.3, -1.0], [0.2, -0.3, -1.0]]) + rng.uniform(-0.25, 0.25, (2, 3))
    fore = np.array([[0.6, -0.2, -1.0], [0.6, 0.2, -1.0]]) + rng.uniform(-0.4, 0.4, (2, 3))
    return unit(np.stack([upper, fore], axis=1))


def arms(left, right):
    return unit(np.array([left, right], dtype=float))


ASIDE = arms([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0]], [[0.0, -1.0, 0.0], [0.0, -1.0, 0.0]])
AHEAD = arms([[0.3, 0.3, -1.0], [1.0, 0.1, 0.0]], [[0.3, -0.3, -1.0], [1.0, -0.1, 0.0]])
HANGING = arms([[0.0, 0.1, -1.0], [0.3, -0.1, -1.0]], [[0.0, -0.1, -1.0], [0.3, 0.1, -1.0]])


def test_the_body_is_that_of_the_service():
    capsules = [c for c in Robot.load(DESCRIPTION).collision.capsules if c.carrier in (Carrier.TORSO, Carrier.BASE)]
    parts = CLEAR_ARMS.trunk, CLEAR_ARMS.pelvis
    assert np.allclose(np.concatenate([part.ends for part in parts]), [(c.start, c.end) for c in capsules], atol=1e-6)
    assert np.array_equal(np.concatenate([part.radii for part in parts]), [c.radius for c in capsules])


@given(seed=seeds)
def test_distances_of_segments_are_those_of_their_points(seed):
    a, b = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 2, 3))
    shares = np.linspace(0.0, 1.0, 201)[:, None]
    p, q = a[0] + shares * (a[1] - a[0]), b[0] + shares * (b[1] - b[0])
    sampled = length(p[:, None] - q[None]).min()
    assert sampled - 0.02 < segment_distances(a, b) <= sampled + 1e-12


def test_segments_without_a_length_and_parallel_ones_have_distances():
    point, along = np.array([[0.0, 0.0, 1.0]] * 2), np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert segment_distances(point, along) == pytest.approx(1.0)
    assert segment_distances(along, point) == pytest.approx(1.0)
    assert segment_distances(point, point) == pytest.approx(0.0)
    assert segment_distances(along, along + np.array([0.5, 2.0, 0.0])) == pytest.approx(2.0)


@pytest.mark.parametrize("limbs", [ASIDE, AHEAD])
def test_what_is_clear_stays_to_the_last_bit(limbs):
    R = hands_of(limbs)
    new_limbs, new_R = CLEAR_ARMS(limbs, R)
    assert np.array_equal(new_limbs, limbs)
    assert np.array_equal(new_R, R)


@given(seed=seeds, side=st.sampled_from([0, 1]))
def test_what_is_inside_comes_out_and_what_is_clear_stays(seed, side):
    limbs = ASIDE.copy()
    limbs[side] = near_the_body(np.random.default_rng(seed))[side]
    R = hands_of(limbs)
    moved, moved_R = CLEAR_ARMS(limbs, R)
    assert np.array_equal(moved[1 - side], limbs[1 - side])
    if CLEAR_ARMS.clearance(limbs, R)[0][side] >= KEPT:
        assert np.array_equal(moved, limbs)
        assert np.array_equal(moved_R, R)
    else:
        after = CLEAR_ARMS.clearance(moved, moved_R)[0][side]
        assert KEPT - ROUNDING <= after <= KEPT + TOO_FAR


@given(seed=seeds)
def test_only_forearms_turn_and_hands_with_them(seed):
    limbs = near_the_body(np.random.default_rng(seed))
    R = hands_of(limbs)
    moved, moved_R = CLEAR_ARMS(limbs, R)
    assert np.array_equal(moved[:, 0], limbs[:, 0])
    assert np.allclose(length(moved), 1.0)
    assert np.allclose(moved_R[:, :, 0], moved[:, 1])
    assert np.allclose(moved_R @ np.swapaxes(moved_R, 1, 2), np.eye(3))
    assert np.allclose(np.linalg.det(moved_R), 1.0)


@given(seed=seeds)
def test_mirrored_arms_are_moved_as_in_a_mirror(seed):
    mirror = np.array([1.0, -1.0, 1.0])
    limbs = near_the_body(np.random.default_rng(seed))
    R = hands_of(limbs)
    other = limbs[::-1] * mirror
    other_R = R[::-1] * mirror[:, None] * mirror
    moved, moved_R = CLEAR_ARMS(limbs, R)
    other_moved, other_moved_R = CLEAR_ARMS(other, other_R)
    # The left and the right hand of the robot are mirrored to a micrometre or so.
    assert np.allclose(other_moved[::-1] * mirror, moved, atol=1e-6)
    assert np.allclose(other_moved_R[::-1] * mirror[:, None] * mirror, moved_R, atol=1e-6)


@settings(max_examples=30)
@given(seed=seeds)
def test_a_small_step_of_the_person_is_a_small_step_of_the_target(seed):
    rng = np.random.default_rng(seed)
    begin, axis = near_the_body(rng), unit(rng.standard_normal((2, 2, 3)))
    step, R, last = 0.004, hands_of(begin), None
    for k in range(40):
        now = rotate(begin, k * step * axis)
        # The hands turn with their forearms.
        turned = np.swapaxes(rotate(np.swapaxes(R, 1, 2), k * step * axis[:, 1][:, None]), 1, 2)
        moved, _ = CLEAR_ARMS(now, turned)
        if last is not None:
            assert length(moved[:, 1] - last[:, 1]).max() < 0.1
        last = moved


def test_hands_leave_the_body_on_the_side_on_which_they_are():
    beside, _ = CLEAR_ARMS(HANGING, hands_of(HANGING))
    assert beside[0, 1, 1] > HANGING[0, 1, 1] + 0.05
    assert beside[1, 1, 1] < HANGING[1, 1, 1] - 0.05
    through = arms([[-0.2, 0.7, -0.7], [0.1, -1.0, 0.0]], [[0.0, -1.0, 0.0], [0.0, -1.0, 0.0]])
    assert CLEAR_ARMS.clearance(through, hands_of(through))[0][0] < 0.0
    before_the_chest, _ = CLEAR_ARMS(through, hands_of(through))
    assert before_the_chest[0, 1, 0] > through[0, 1, 0] + 0.3
    behind = arms([[-0.5, 0.1, -1.0], [-0.1, -0.7, -1.0]], [[0.0, -1.0, 0.0], [0.0, -1.0, 0.0]])
    assert CLEAR_ARMS.clearance(behind, hands_of(behind))[0][0] < KEPT
    still_behind, _ = CLEAR_ARMS(behind, hands_of(behind))
    assert still_behind[0, 1, 0] < 0.0


def test_hands_that_meet_leave_each_other_by_the_same_angle():
    folded = arms([[0.3, 0.2, -1.0], [1.0, -0.42, 0.0]], [[0.3, -0.2, -1.0], [1.0, 0.42, 0.0]])
    R = hands_of(folded)
    assert CLEAR_ARMS.clearance(folded, R)[1] < KEPT
    moved, moved_R = CLEAR_ARMS(folded, R)
    assert CLEAR_ARMS.clearance(moved, moved_R)[1] >= KEPT - ROUNDING
    turned = np.arccos((moved[:, 1] * folded[:, 1]).sum(axis=1))
    assert turned[0] == pytest.approx(turned[1], abs=1e-6)
    assert turned[0] > 0.02


WAISTS = [np.array(waist) for waist in ((0.6, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.4), (-0.4, -0.2, 0.3))]
"""Yaw, roll and pitch of the waist [rad]."""


def body_by_mujoco(waist):
    """Ends and radii of the capsules of trunk and pelvis, pelvis frame."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(DESCRIPTION.model))
    data = mujoco.MjData(model)
    for name, angle in zip(DESCRIPTION.waist, waist, strict=True):
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    pelvis = data.body(DESCRIPTION.base)
    bodies = {DESCRIPTION.base: pelvis, DESCRIPTION.waist[-1]: data.body(model.joint(DESCRIPTION.waist[-1]).bodyid[0])}
    ends, radii = [], []
    for capsule in DESCRIPTION.collision.capsules:
        if capsule.body in bodies:
            body = bodies[capsule.body]
            world = np.array([capsule.start, capsule.end]) @ body.xmat.reshape(3, 3).T + body.xpos
            ends.append((world - pelvis.xpos) @ pelvis.xmat.reshape(3, 3))
            radii.append(capsule.radius)
    return np.array(ends), np.array(radii)


def near_a_bent_body(rng, robot):
    """Arms as `near_the_body`, by a trunk that is bent."""
    return near_the_body(rng) @ robot.R_waist.T


@pytest.mark.parametrize("waist", WAISTS)
def test_a_bent_waist_takes_the_body_along(waist):
    """Distances of hands from trunk and pelvis are those from where MuJoCo has them."""
    robot = GEOMETRY.bent(waist)
    clear_arms = ClearArms(GEOMETRY.arms, DESCRIPTION)
    ends, radii = body_by_mujoco(waist)
    for seed in range(20):
        limbs = near_a_bent_body(np.random.default_rng(seed), robot)
        R = hands_of(limbs)
        found, _ = clear_arms.clearance(limbs, R, robot)
        elbows = shoulder_positions(limbs[:, 0], robot) + robot.upper * limbs[:, 0]
        for side, arm in enumerate(DESCRIPTION.arms):
            wrist = elbows[side] + robot.fore * limbs[side, 1]
            capsules = DESCRIPTION.collision.capsules
            parts = [
                (wrist + (np.array([c.start, c.end]) - arm.wrist.xyz) @ R[side].T, c.radius)
                for c in capsules
                if c.body == arm.wrist.joint
            ]
            along = np.array([FOREARM_FROM * robot.fore, robot.fore - arm.wrist.xyz[0]])
            forearm = next(c for c in capsules if c.body == arm.elbow)
            parts.append((elbows[side] + along[:, None] * limbs[side, 1], forearm.radius))
            gaps = [segment_distances(part, ends) - radii - radius for part, radius in parts]
            assert found[side] == pytest.approx(np.min(gaps), abs=1e-6)


@pytest.mark.parametrize("waist", WAISTS)
def test_what_is_inside_a_bent_body_comes_out(waist):
    robot, inside, ignorant = GEOMETRY.bent(waist), 0, 0
    for seed in range(60):
        limbs = near_a_bent_body(np.random.default_rng(seed), robot)
        # The other arm is out of the way.
        limbs[1] = ASIDE[1] @ robot.R_waist.T
        R = hands_of(limbs)
        moved, moved_R = CLEAR_ARMS(limbs, R, robot)
        assert np.array_equal(moved[1], limbs[1])
        if CLEAR_ARMS.clearance(limbs, R, robot)[0][0] >= KEPT:
            assert np.array_equal(moved, limbs)
            assert np.array_equal(moved_R, R)
            continue
        inside += 1
        assert KEPT - ROUNDING <= CLEAR_ARMS.clearance(moved, moved_R, robot)[0][0] <= KEPT + TOO_FAR
        assert np.allclose(moved_R[:, :, 0], moved[:, 1])
        as_if_straight = CLEAR_ARMS(limbs, R)
        ignorant += CLEAR_ARMS.clearance(*as_if_straight, robot)[0][0] < KEPT - ROUNDING
    assert inside > 10
    # The negative control: a body that is not looked for where it is.
    assert ignorant > inside / 8


def test_arms_of_a_trunk_that_turns_are_moved_as_it_turns():
    """But for the pelvis, which stays: arms that are high enough never see it."""
    straight = arms([[0.3, 0.3, -1.0], [0.5, -0.8, 0.1]], [[0.3, -0.3, -1.0], [0.2, 0.9, 0.0]])
    robot = GEOMETRY.bent(WAISTS[0])
    bent = straight @ robot.R_waist.T
    moved, _ = CLEAR_ARMS(straight, hands_of(straight))
    turned, _ = CLEAR_ARMS(bent, robot.R_waist @ hands_of(straight), robot)
    assert np.abs(moved - straight).max() > 0.01
    assert np.allclose(turned, moved @ robot.R_waist.T, atol=1e-9)


def test_the_tracker_says_how_the_waist_stands():
    told = []

    class Watched(ClearArms):
        def __call__(self, limbs, R_pelvis_wrist, robot=None):
            told.append(robot)
            return super().__call__(limbs, R_pelvis_wrist, robot)

    source = CameraTracker(G1_ARMS, lambda _now: True, clear=Watched(G1_ARMS, DESCRIPTION))
    source.feed(look(1.0))
    source.hands(1.0)
    source.robot = GEOMETRY.bent(WAISTS[0])
    source.hands(1.0)
    assert told == [G1_ARMS, source.robot]
