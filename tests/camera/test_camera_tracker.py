"""The camera as a source of hands: when they are followed, where they are, whose they are."""

import numpy as np
import pytest
from looks import estimate, look
from painted_person import BENT, DOWN, FORWARD, HANGING, LEFT, SPREAD, limbs

from camera_client.approach import Approach, Stage
from camera_client.clear_arms import ClearArms
from camera_client.mirror import mirrored
from camera_client.scaling import G1_ARMS, wrist_positions
from camera_client.tracker import OLDEST, CameraTracker
from ik_client.types import Hands
from ik_proto.robots import load_description

S = np.diag([1.0, -1.0, 1.0])


def tracker(held: bool | None = True, **options) -> CameraTracker:
    return CameraTracker(G1_ARMS, lambda _now: held, **options)


def hands(source: CameraTracker, now: float) -> Hands:
    found = source.hands(now)
    assert found is not None
    return found


def tracked(found: Hands) -> tuple[bool, bool]:
    assert found.left is not None
    assert found.right is not None
    return found.left.tracked, found.right.tracked


def test_before_anybody_was_seen_there_are_no_hands():
    source = tracker()
    assert source.hands(1.0) is None
    assert source.trouble(1.0) == "no frame yet"
    source.feed(look(1.0, nobody=True))
    assert source.hands(1.0) is None
    assert source.trouble(1.0) == "nobody faces the camera"


def test_wrists_are_the_robots_in_the_operators_directions():
    source = tracker()
    source.feed(look(1.0))
    found = hands(source, 1.0)
    assert tracked(found) == (True, True)
    for side, hand in enumerate((found.left, found.right)):
        assert hand is not None
        assert hand.grip is True
        assert np.allclose(hand.pose[:3, 3], wrist_positions(BENT, G1_ARMS)[side])
        assert np.allclose(hand.pose[:3, 0], BENT[side, 1])  # the wrist's x is along the forearm
    assert found.left_elbow is not None
    assert found.right_elbow is not None
    assert (found.left_elbow[3], found.right_elbow[3]) == (0.5, 1.0)
    assert found.weights is not None
    assert np.array_equal(found.weights, estimate(1.0).weights)


def test_forearms_are_turned_out_of_the_robots_body_where_that_is_asked_for():
    """Hands at the belly: asked for before it, on the person's side; arms that are clear are asked for as they are."""
    at_the_belly = limbs((DOWN + 0.2 * LEFT, -0.9 * LEFT - 0.3 * FORWARD), (DOWN - 0.2 * LEFT, DOWN - 0.5 * LEFT))
    clear = ClearArms(G1_ARMS, load_description("g1"))
    asked = []
    for turned in (clear, None):
        source = tracker(clear=turned)
        source.feed(look(1.0, estimate(1.0, at_the_belly)))
        found = hands(source, 1.0)
        assert found.left is not None
        assert found.right is not None
        asked.append((found.left.pose, found.right.pose))
        assert found.left_elbow is not None
    (left, right), (left_before, right_before) = asked
    assert np.linalg.norm(left[:3, 3] - left_before[:3, 3]) > 0.05
    assert np.array_equal(right, right_before)
    assert left[:3, :3] @ left[:3, :3].T == pytest.approx(np.eye(3), abs=1e-9)
    assert wrist_positions(at_the_belly, G1_ARMS)[0] == pytest.approx(left_before[:3, 3])


def test_a_frame_that_is_old_shows_no_hands():
    source = tracker()
    source.feed(look(1.0))
    assert tracked(hands(source, 1.0 + OLDEST - 1e-6)) == (True, True)
    assert source.trouble(1.0 + OLDEST - 1e-6) == ""
    assert tracked(hands(source, 1.0 + OLDEST + 1e-6)) == (False, False)
    assert source.trouble(1.5) == "no frame for 0.5 s"
    # Of the future: a clock has been set back.
    assert tracked(hands(source, 0.9)) == (False, False)


def test_capture_counts_and_not_when_the_frame_came():
    source = tracker()
    source.feed(look(1.0, received=1.2, ready=1.25))
    assert tracked(hands(source, 1.26)) == (False, False)


@pytest.mark.parametrize(("held", "grip", "followed"), [(True, True, True), (False, False, True), (None, None, False)])
def test_a_switch_that_cannot_be_told_loses_the_hands(held, grip, followed):
    source = tracker(held)
    source.feed(look(1.0))
    found = hands(source, 1.0)
    assert found.left is not None
    assert found.left.grip is grip
    assert tracked(found) == (followed, followed)


@pytest.mark.parametrize("held", [True, False, None])
def test_a_recorded_switch_plays_along(held):
    source = CameraTracker(G1_ARMS)
    assert source.held(1.0) is None
    source.feed(look(1.0, held=held))
    assert source.held(1.0) is held
    found = hands(source, 1.0)
    assert found.left is not None
    assert found.left.grip is held


def test_an_arm_that_is_not_seen_or_hardly_is_lost_alone():
    source = tracker()
    source.feed(look(1.0, estimate(1.0, tracked=np.array([False, True]), note="the left arm is out of view")))
    assert tracked(hands(source, 1.0)) == (False, True)
    assert source.trouble(1.0) == ""
    source.feed(look(1.0, estimate(1.0, confidence=np.array([1.0, 0.01]))))
    assert tracked(hands(source, 1.0)) == (True, False)
    source.feed(look(1.0, estimate(1.0, tracked=np.zeros(2, dtype=bool), note="somebody else is before the camera")))
    assert tracked(hands(source, 1.0)) == (False, False)
    assert source.trouble(1.0) == "somebody else is before the camera"


def test_hands_are_where_they_will_be_when_the_command_counts():
    """A forearm that swings up at 1 m/s: the wrist is predicted to the tick and a lead beyond it."""
    velocity = np.zeros((2, 3, 3))
    velocity[0, 2] = [0.0, 0.0, 1.0]
    moved = {}
    for lead in (0.0, 0.04):
        source = tracker(lead=lead)
        source.feed(look(1.0, estimate(1.0, velocity=velocity)))
        at_once, later = hands(source, 1.0), hands(source, 1.04)
        assert at_once.left is not None
        assert later.left is not None
        assert later.right is not None
        assert np.allclose(later.right.pose[:3, 3], wrist_positions(BENT, G1_ARMS)[1])
        moved[lead] = at_once.left.pose[2, 3], later.left.pose[2, 3]
    assert moved[0.0][0] < moved[0.0][1] == pytest.approx(moved[0.04][0])
    assert moved[0.04][0] < moved[0.04][1]


def test_in_a_mirror_left_and_right_are_swapped():
    lopsided = limbs((HANGING[0, 0], HANGING[0, 1]), (SPREAD[1, 0], BENT[1, 1]))
    plain, swapped = tracker(), tracker(mirror=True)
    for source in (plain, swapped):
        source.feed(look(1.0, estimate(1.0, lopsided, tracked=np.array([False, True]))))
    a, b = hands(plain, 1.0), hands(swapped, 1.0)
    assert a.left is not None
    assert a.right is not None
    assert b.left is not None
    assert b.right is not None
    assert tracked(b) == (True, False)
    assert np.allclose(b.left.pose[:3, 3], S @ a.right.pose[:3, 3], atol=1e-4)
    assert np.allclose(b.left.pose[:3, :3], S @ a.right.pose[:3, :3] @ S)
    assert np.linalg.det(b.left.pose[:3, :3]) == pytest.approx(1.0)
    assert b.weights is not None
    assert a.weights is not None
    assert np.array_equal(b.weights, a.weights[::-1])
    assert b.left_elbow is not None
    assert b.left_elbow[3] == 1.0


def test_a_mirror_of_a_mirror_is_no_mirror():
    arms = estimate(1.0, limbs((HANGING[0, 0], HANGING[0, 1]), (SPREAD[1, 0], BENT[1, 1])))
    twice = mirrored(mirrored(arms))
    for name in ("limbs", "joints", "velocity", "R_pelvis_wrist", "confidence", "bend", "tracked", "elbow_confidence"):
        assert np.allclose(getattr(twice, name), getattr(arms, name)), name
    assert twice.yaw == arms.yaw


def test_an_arm_that_goes_home_is_not_told_where_the_operators_elbow_is():
    approaches = Approach(0, 0.2, home_first=True), Approach(1, 0.2, home_first=False)
    source = tracker(approaches=approaches)
    source.feed(look(1.0, estimate(1.0, bend=np.array([0.5, 0.5]))))
    found = hands(source, 1.0)
    assert approaches[0].stage is Stage.HOME
    assert found.left_elbow is None
    assert found.right_elbow is not None
    assert found.weights is not None
    assert found.weights[0].tolist() == [1.0, 1.0]
    assert found.weights[1, 1] < 1.0
