"""Capsules and checked pairs: what carries what, which pairs are checked, and what the G1's say of its postures."""

from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from capsule_oracles import PinocchioScene

from ik_proto.robots import CapsuleDescription, RobotDescription, RobotError, load_description
from ik_service.collision import Carrier, CollisionModel
from ik_service.robot import Robot

ARMS = (Carrier.LEFT, Carrier.RIGHT)


@pytest.fixture(scope="module")
def full(description: RobotDescription) -> pin.Model:
    return pin.buildModelFromMJCF(str(description.model))


@pytest.fixture(scope="module")
def g1(description: RobotDescription, full: pin.Model) -> CollisionModel:
    return CollisionModel.of(description, full)


@pytest.fixture(scope="module")
def scene(description: RobotDescription) -> PinocchioScene:
    return PinocchioScene(description)


@pytest.fixture(scope="module")
def named(g1: CollisionModel) -> list[tuple[str, str]]:
    """The checked pairs by name."""
    return [(g1.capsules[a].name, g1.capsules[b].name) for a, b in g1.pairs]


def side_of(capsule: CapsuleDescription, description: RobotDescription) -> str:
    return next((arm.side for arm in description.arms if capsule.body in arm.joints), "")


def test_carriers_of_the_g1(g1: CollisionModel) -> None:
    carried = {capsule.name: (capsule.carrier, capsule.joint) for capsule in g1.capsules}
    assert carried["left_forearm"] == (Carrier.LEFT, 3)
    assert carried["right_thumb"] == (Carrier.RIGHT, 6)
    assert carried["head"] == (Carrier.TORSO, -1)
    assert carried["right_thigh"] == (Carrier.BASE, -1)


def test_a_reduced_model_gives_the_same(description: RobotDescription, full: pin.Model, g1: CollisionModel) -> None:
    kept = {*description.arm_joints, *description.waist}
    locked = [full.getJointId(name) for name in list(full.names)[1:] if name not in kept]
    reduced = CollisionModel.of(description, pin.buildReducedModel(full, locked, pin.neutral(full)))
    assert reduced.pairs == g1.pairs
    for ours, theirs in zip(reduced.capsules, g1.capsules, strict=True):
        assert (ours.name, ours.carrier, ours.joint) == (theirs.name, theirs.carrier, theirs.joint)
        assert np.allclose([ours.start, ours.end], [theirs.start, theirs.end], rtol=0.0, atol=1e-12)


def test_every_pair_that_an_arm_can_change_is_checked_or_ignored(
    description: RobotDescription, named: list[tuple[str, str]]
) -> None:
    wanted = {
        frozenset((a.name, b.name))
        for a, b in combinations(description.collision.capsules, 2)
        if a.body != b.body and (side_of(a, description) or side_of(b, description))
    }
    ignored = {frozenset(entry.pair) for entry in description.collision.ignored}
    assert ignored <= wanted, "an ignored pair would not be checked anyhow"
    assert {frozenset(pair) for pair in named} == wanted - ignored
    assert len(named) == len(wanted) - len(ignored)


def test_pairs_come_in_runs_with_the_arm_first(g1: CollisionModel) -> None:
    assert [*g1.left, *g1.right, *g1.across] == list(range(len(g1.pairs)))
    for run, carrier in ((g1.left, Carrier.LEFT), (g1.right, Carrier.RIGHT)):
        for a, b in (g1.pairs[k] for k in run):
            first, second = g1.capsules[a], g1.capsules[b]
            assert first.carrier is carrier
            assert second.carrier not in ARMS or (second.carrier is carrier and second.joint < first.joint)
    for a, b in (g1.pairs[k] for k in g1.across):
        assert (g1.capsules[a].carrier, g1.capsules[b].carrier) == ARMS


def test_hands_are_checked_against_their_own_upper_arm(named: list[tuple[str, str]]) -> None:
    for side in ("left", "right"):
        for part in ("wrist", "thumb", "fingers"):
            assert (f"{side}_{part}", f"{side}_upper_arm") in named


def test_both_sides_are_alike(g1: CollisionModel, named: list[tuple[str, str]]) -> None:
    def swapped(name: str) -> str:
        return name.replace("left", "other").replace("right", "left").replace("other", "right")

    capsules = {capsule.name: capsule for capsule in g1.capsules}
    mirror = np.array([1.0, -1.0, 1.0])
    for name, capsule in capsules.items():
        other = capsules[swapped(name)]
        assert other.radius == capsule.radius
        ends = sorted(map(tuple, (capsule.start * mirror, capsule.end * mirror)))
        assert np.allclose(ends, sorted(map(tuple, (other.start, other.end))), rtol=0.0, atol=1e-12)
    assert {frozenset(map(swapped, pair)) for pair in named} == set(map(frozenset, named))


def test_home_and_zero_keep_the_margin(
    description: RobotDescription, g1: CollisionModel, named: list[tuple[str, str]], scene: PinocchioScene
) -> None:
    home = np.array([description.joint(name).home for name in description.arm_joints])
    for q in (home, np.zeros(14)):
        assert scene.distances(q, np.zeros(3), named).min() >= g1.margin


def ignored_for(description: RobotDescription, reason: str) -> list[tuple[str, str]]:
    return [entry.pair for entry in description.collision.ignored if entry.reason.startswith(reason)]


def postures(description: RobotDescription, full: pin.Model, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Random postures of the arms, the waist bent as far as it goes."""
    rng = np.random.default_rng(7)
    arm, waist = (
        [full.joints[full.getJointId(name)].idx_q for name in names]
        for names in (description.arm_joints, description.waist)
    )
    lower, upper = full.lowerPositionLimit, full.upperPositionLimit
    return [
        (rng.uniform(lower[arm], upper[arm]), np.where(rng.random(3) < 0.5, lower[waist], upper[waist]))
        for _ in range(count)
    ]


def test_pairs_out_of_reach_never_meet(description: RobotDescription, full: pin.Model, scene: PinocchioScene) -> None:
    pairs = ignored_for(description, "out of reach")
    assert len(pairs) == 12
    assert min(scene.distances(*posture, pairs).min() for posture in postures(description, full, 1000)) > 0.0


def test_joined_pairs_always_meet(description: RobotDescription, full: pin.Model, scene: PinocchioScene) -> None:
    pairs = ignored_for(description, "joined by")
    assert len(pairs) == 8
    assert max(scene.distances(*posture, pairs).max() for posture in postures(description, full, 200)) < 0.0


def test_only_the_upper_arms_see_the_core_of_the_torso(named: list[tuple[str, str]]) -> None:
    core = {pair[0] for pair in named if pair[1] == "torso_core"}
    assert core == {"left_upper_arm", "right_upper_arm"}
    for arm in ("left", "right"):
        for part in ("forearm", "wrist", "thumb", "fingers"):
            assert {(f"{arm}_{part}", f"torso_{side}") for side in ("left", "right")} <= set(named)


def test_base_ends_follow_the_waist(
    robot: Robot, description: RobotDescription, full: pin.Model, g1: CollisionModel
) -> None:
    base = [capsule for capsule in g1.capsules if capsule.carrier is Carrier.BASE]
    straight = g1.base_ends(np.eye(4))
    assert np.array_equal(straight, [(capsule.start, capsule.end) for capsule in base])
    waist = np.array([0.7, -0.3, 0.4])
    data, q = full.createData(), pin.neutral(full)
    torso = full.getJointId(description.waist[-1])
    pin.forwardKinematics(full, data, q)
    T_straight = data.oMi[torso].copy()
    q[[full.joints[full.getJointId(name)].idx_q for name in description.waist]] = waist
    pin.forwardKinematics(full, data, q)
    T_base_mount = data.oMi[torso] * T_straight.inverse()
    bent = g1.base_ends(T_base_mount.homogeneous)
    for seen, ends in zip(bent.reshape(-1, 3), straight.reshape(-1, 3), strict=True):
        assert np.allclose(T_base_mount.act(seen), ends, rtol=0.0, atol=1e-12)
    assert np.allclose(robot.waist.motion(waist), T_base_mount.homogeneous, rtol=0.0, atol=1e-12)


def rewritten(folder: Path, description: RobotDescription, old: str, new: str) -> RobotDescription:
    """The G1's description with one piece of its text replaced."""
    text = description.source.read_text()
    assert old in text
    (folder / "g1.xml").write_text(description.model.read_text())
    (folder / "g1.toml").write_text(text.replace(old, new))
    return load_description(folder / "g1.toml")


def test_a_body_that_does_not_exist_is_named(tmp_path: Path, description: RobotDescription, full: pin.Model) -> None:
    changed = rewritten(tmp_path, description, 'body = "left_elbow_joint"', 'body = "left_elbow_link"')
    words = "capsule left_forearm: body left_elbow_link is neither a joint of g1.xml nor its base pelvis"
    with pytest.raises(RobotError, match=words) as error:
        CollisionModel.of(changed, full)
    assert "\n" not in str(error.value)


def test_a_body_that_moves_with_a_part_of_the_waist_is_refused(
    tmp_path: Path, description: RobotDescription, full: pin.Model
) -> None:
    changed = rewritten(
        tmp_path, description, 'name = "pelvis"\nbody = "pelvis"', 'name = "pelvis"\nbody = "waist_yaw_joint"'
    )
    words = "waist_yaw_joint moves with a part of the waist only; put it on pelvis or on waist_pitch_joint"
    with pytest.raises(RobotError, match=words) as error:
        CollisionModel.of(changed, full)
    assert "\n" not in str(error.value)


def test_a_locked_joint_is_where_it_is_at_zero(tmp_path: Path, description: RobotDescription, full: pin.Model) -> None:
    changed = rewritten(
        tmp_path,
        description,
        'name = "hips"\nbody = "pelvis"',
        'name = "hips"\nbody = "left_knee_joint"',
    )
    hips = next(capsule for capsule in CollisionModel.of(changed, full).capsules if capsule.name == "hips")
    assert hips.carrier is Carrier.BASE
    data = full.createData()
    pin.forwardKinematics(full, data, pin.neutral(full))
    written = next(capsule for capsule in changed.collision.capsules if capsule.name == "hips")
    assert np.allclose(hips.start, data.oMi[full.getJointId("left_knee_joint")].act(np.array(written.start)))


CAPSULE_TOML = """
[collision]
margin = 0.01
[[collision.capsules]]
name = "trunk"
body = "trunk"
from = [0.0, 0.0, 0.0]
to = [0.0, 0.0, 0.3]
radius = 0.1
[[collision.capsules]]
name = "hand"
body = "a_4"
from = [0.0, 0.0, 0.0]
to = [0.1, 0.0, 0.0]
radius = 0.03
"""


def test_a_robot_without_a_waist_carries_its_base_along(make_robot: Callable[..., Path]) -> None:
    description = load_description(make_robot(replace_toml=("[presets", f"{CAPSULE_TOML}\n[presets")))
    model = CollisionModel.of(description, pin.buildModelFromUrdf(str(description.model)))
    assert [capsule.carrier for capsule in model.capsules] == [Carrier.TORSO, Carrier.RIGHT]
    assert model.pairs == ((1, 0),)
    assert (len(model.left), len(model.right), len(model.across)) == (0, 1, 0)
    assert model.base_ends(np.eye(4)).shape == (0, 2, 3)


def test_a_robot_without_capsules_has_no_pairs(make_robot: Callable[..., Path]) -> None:
    description = load_description(make_robot())
    model = CollisionModel.of(description, pin.buildModelFromUrdf(str(description.model)))
    assert (model.capsules, model.pairs) == ((), ())
    assert not [*model.left, *model.right, *model.across]


BOXES = {
    "waist_pitch_joint": ((-0.0686, -0.1077, -0.0089), (0.0836, 0.1077, 0.4866)),
    "left_shoulder_yaw_joint": ((-0.0328, -0.0414, -0.1137), (0.0484, 0.0331, 0.0316)),
    "left_elbow_joint": ((-0.0298, -0.0313, -0.0454), (0.1, 0.0348, 0.0298)),
    "left_wrist_pitch_joint": ((-0.0285, -0.0285, -0.0285), (0.0745, 0.0285, 0.0285)),
    "left_wrist_yaw_joint": ((0.0, -0.0449, -0.043), (0.1733, 0.03, 0.0634)),
    "pelvis": ((-0.0581, -0.0678, -0.152), (0.0614, 0.0678, 0.0025)),
}
"""Bounding boxes of the meshes of Unitree's links by the joint that moves them [m]; the torso's with its head, the
hand's without its near end, which is in the wrist's capsule."""


@pytest.mark.parametrize("body", BOXES)
def test_capsules_reach_every_face_of_the_links_box(description: RobotDescription, body: str) -> None:
    """A mesh touches each face of its bounding box, so capsules that cover it reach as far.

    Necessary, and cheap; `tests/robot/test_g1_capsules.py` proves the cover on the meshes.
    """
    capsules = [capsule for capsule in description.collision.capsules if capsule.body == body]
    lower = np.min([np.minimum(c.start, c.end) - c.radius for c in capsules], axis=0)
    upper = np.max([np.maximum(c.start, c.end) + c.radius for c in capsules], axis=0)
    assert (lower <= BOXES[body][0]).all()
    assert (upper >= BOXES[body][1]).all()
