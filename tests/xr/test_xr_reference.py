"""The frames hands are given in: the seeds' own, quirks included, and one that stands still."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from xr_samples import pose, poses, vectors

from ik_client.gate import PoseGate, Verdict
from ik_client.hand import HandSample
from ik_client.rotation import rotation_matrix
from xr_client.calibration import Neck
from xr_client.frames import SEED_GRIP, Side, to_robot, wrist_of_grip, wrist_of_hand
from xr_client.look import Look
from xr_client.reference import HeadReference, StandingReference

HEAD = pose((0.1, -0.2, 1.6))
LEFT, RIGHT = pose((0.5, 0.1, 1.2)), pose((0.5, -0.4, 1.3), (0.2, 0.3, 0.4))
ABOUT_Z = np.array([0.0, 0.0, 1.0])


def sample(T, grip: bool | None = False, stamp=0.0, tracked=True) -> HandSample:
    return HandSample(T, grip, stamp, tracked)


def look(head=HEAD, left=LEFT, right=RIGHT, *, grip: bool | None = False) -> Look:
    return Look(head, sample(left, grip), sample(right, grip))


class SeedWrapper:
    """What xr_teleoperate's tv_wrapper does with three matrices, step by step, written from its description."""

    BASIS = np.array([[0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    LEFT = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    RIGHT = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
    CONSTANTS = pose((0, 1.5, -0.2)), pose((-0.15, 1.13, -0.3)), pose((0.15, 1.13, -0.3))

    def __call__(self, head, left, right):
        given_ = [head, left, right]
        valid = [np.linalg.det(T) != 0 for T in given_]
        used = [T if ok else constant for T, ok, constant in zip(given_, valid, self.CONSTANTS, strict=True)]
        head, left, right = (self.BASIS @ T @ np.linalg.inv(self.BASIS) for T in used)
        left = left @ (self.LEFT if valid[1] else np.eye(4))
        right = right @ (self.RIGHT if valid[2] else np.eye(4))
        for wrist in (left, right):
            wrist[:3, 3] -= head[:3, 3]
            wrist[0, 3] += 0.15
            wrist[2, 3] += 0.45
        return left, right


@given(poses(), poses(), poses())
def test_the_head_reference_is_the_seeds(head, left, right):
    expected = SeedWrapper()(head, left, right)
    got = HeadReference().hands(
        look(to_robot(head), wrist_of_hand(left, Side.LEFT), wrist_of_hand(right, Side.RIGHT)),
    )
    assert got.left is not None
    assert got.right is not None
    np.testing.assert_allclose(got.left.pose, expected[0], atol=1e-12)
    np.testing.assert_allclose(got.right.pose, expected[1], atol=1e-12)


def test_the_seeds_constants_land_near_the_arms_at_rest():
    """Their default wrists, taken without the wrist's quarter turn, are (0.25, +-0.15, 0.08), unturned."""
    head, left, right = SeedWrapper.CONSTANTS
    got = HeadReference().hands(look(to_robot(head), wrist_of_grip(left, SEED_GRIP), wrist_of_grip(right, SEED_GRIP)))
    nothing = np.zeros((4, 4))
    seed = SeedWrapper()(nothing, nothing, nothing)
    for ours, theirs, y in ((got.left, seed[0], 0.15), (got.right, seed[1], -0.15)):
        assert ours is not None
        np.testing.assert_allclose(ours.pose, pose((0.25, y, 0.08)), atol=1e-12)
        np.testing.assert_allclose(ours.pose, theirs, atol=1e-12)


def test_where_the_seeds_let_arms_follow_the_head_ours_says_that_hands_are_missing():
    """The quirk behind "the arms follow the operator's head": a missing hand is a constant in the room."""
    nothing = np.zeros((4, 4))
    heads = [pose((0.0, 1.5, 0.0)), pose((0.0, 1.5, -0.3))]
    before, after = (SeedWrapper()(head, nothing, nothing)[0] for head in heads)
    np.testing.assert_allclose(after[:3, 3] - before[:3, 3], [-0.3, 0.0, 0.0], atol=1e-12)
    for head in heads:
        got = HeadReference().hands(Look(to_robot(head), None, sample(RIGHT, tracked=False)))
        assert got.left is None
        assert got.right is not None
        assert not got.right.tracked


@pytest.mark.parametrize("reference", [HeadReference(), StandingReference()])
def test_without_a_head_nothing_is_tracked(reference):
    got = reference.hands(look(head=None))
    assert not got.left.tracked
    assert not got.right.tracked


@given(vectors(3.0), st.floats(-3.0, 3.0), st.floats(-1.2, 1.2), st.floats(-0.5, 0.5))
def test_forward_is_where_the_operator_looks(place, yaw, pitch, roll):
    """Head and hands turned about the vertical together, wherever they are: the same hands."""
    tilted = pose((0, 0, 1.6), (0, pitch, 0)) @ pose((0, 0, 0), (roll, 0, 0))
    moved = pose(place, yaw * ABOUT_Z)
    plain = StandingReference().hands(look(tilted))
    turned = StandingReference().hands(look(moved @ tilted, moved @ LEFT, moved @ RIGHT))
    for a, b in ((plain.left, turned.left), (plain.right, turned.right)):
        assert a is not None
        assert b is not None
        assert b.tracked
        np.testing.assert_allclose(a.pose, b.pose, atol=1e-9)


@given(poses())
def test_while_gripped_no_motion_of_the_head_moves_a_hand(head):
    reference = StandingReference()
    reference.hands(look())
    before = reference.hands(look(grip=True)).left
    after = reference.hands(look(head, grip=True)).left
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(before.pose, after.pose)
    assert after.tracked


def test_a_hand_moves_as_it_does_in_the_room():
    """What the clutch sees: way and turn, in the axes of where the operator looked at the grip."""
    reference = StandingReference()
    yaw = rotation_matrix(0.7 * ABOUT_Z)
    reference.hands(look(pose((0.3, 0.1, 1.6), 0.7 * ABOUT_Z)))
    before, after = (
        reference.hands(look(HEAD, T, grip=True)).left for T in (LEFT, pose((0.6, 0.1, 1.25), (0.0, 0.2, 0.1)))
    )
    assert before is not None
    assert after is not None
    np.testing.assert_allclose(after.pose[:3, 3] - before.pose[:3, 3], yaw.T @ [0.1, 0.0, 0.05], atol=1e-12)
    expected = yaw.T @ rotation_matrix(np.array([0.0, 0.2, 0.1])) @ yaw
    np.testing.assert_allclose(after.pose[:3, :3] @ before.pose[:3, :3].T, expected, atol=1e-12)


def test_the_second_grip_keeps_the_anchor_of_the_first():
    reference = StandingReference()
    reference.hands(look())
    first = Look(HEAD, sample(LEFT, True), sample(RIGHT, False))
    before = reference.hands(first)
    turned = pose((0.1, -0.2, 1.6), 1.0 * ABOUT_Z)
    both = reference.hands(Look(turned, sample(LEFT, True), sample(RIGHT, True)))
    second = reference.hands(Look(turned, sample(LEFT, False), sample(RIGHT, True)))
    for got in (both, second):
        assert got.left is not None
        assert before.left is not None
        np.testing.assert_array_equal(got.left.pose, before.left.pose)


def test_an_unknown_grip_keeps_the_anchor():
    reference = StandingReference()
    reference.hands(look())
    before = reference.hands(look(grip=True)).left
    after = reference.hands(look(pose((0, 0, 1.6), ABOUT_Z), grip=None)).left
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(before.pose, after.pose)


def test_letting_go_re_anchors_and_the_gate_takes_it_for_no_jump():
    """The hands are lost for one tick, and then where they are now; nothing has to be rejected as a jump."""
    reference, gate = StandingReference(), PoseGate()
    turned = pose((0.1, -0.2, 1.6), 1.5 * ABOUT_Z)
    looks = [look(), look(grip=True), look(turned, grip=True), look(turned), look(turned)]
    verdicts = []
    for k, one in enumerate(looks):
        moved = replace(one, left=sample(pose((0.5, 0.1 + 1e-4 * k, 1.2)), k in (1, 2), float(k)))
        verdicts.append(gate.check(reference.hands(moved).left, 0.011 * k).verdict)
    assert verdicts == [Verdict.OK, Verdict.OK, Verdict.OK, Verdict.UNTRACKED, Verdict.OK]


def test_looking_straight_down_keeps_forward():
    reference = StandingReference()
    reference.hands(look(pose((0, 0, 1.6), 0.5 * ABOUT_Z)))
    down = pose((0, 0, 1.6), (0.0, np.pi / 2, 0.0))
    got = reference.hands(look(down)).left
    assert got is not None
    assert got.tracked
    np.testing.assert_allclose(got.pose[:3, :3], rotation_matrix(-0.5 * ABOUT_Z), atol=1e-12)
    lost = StandingReference().hands(look(down)).left
    assert lost is not None
    assert not lost.tracked


@given(vectors(1.0), vectors(1.5))
def test_with_a_known_neck_the_operator_may_walk_and_look_around(step, rotation):
    """Hands that come along with the body are the same, however the head turns about the neck."""
    neck = Neck(np.array([-0.1, 0.0, -0.15]), 0.0)
    reference = StandingReference(neck)
    reference.hands(look())
    before = reference.hands(look(grip=True)).left
    pivot = neck.point(HEAD) + step
    head = pose(pivot, rotation) @ pose(-neck.offset)
    after = reference.hands(look(head, pose(step) @ LEFT, grip=True)).left
    assert before is not None
    assert after is not None
    np.testing.assert_allclose(before.pose, after.pose, atol=1e-12)
    lost = reference.hands(look(None, grip=True)).left
    assert lost is not None
    assert not lost.tracked
