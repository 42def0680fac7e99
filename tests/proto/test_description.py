"""Robot descriptions: the packaged one reads, and every mistake gets one line that names it."""

from pathlib import Path

import pytest

from ik_proto.robots import CollisionDescription, RobotError, load_description

GOOD = """
name = "two"
model = "two.xml"
base = "base"
[[arms]]
side = "left"
joints = ["a", "b"]
[arms.wrist]
name = "L"
joint = "b"
xyz = [0.1, 0, 0]
[[arms]]
side = "right"
joints = ["c"]
[arms.wrist]
name = "R"
joint = "c"
[joints.a]
kp = 3
[presets.openwbt]
position = 50.0
"""


def write(folder: Path, text: str) -> Path:
    (folder / "two.xml").write_text("<mujoco/>")
    (folder / "two.toml").write_text(text)
    return folder / "two.toml"


def test_the_packaged_g1_has_fourteen_arm_joints_left_first() -> None:
    g1 = load_description("g1")
    assert len(g1.arm_joints) == 14
    assert g1.arm_joints[0] == "left_shoulder_pitch_joint"
    assert g1.arm_joints[7] == "right_shoulder_pitch_joint"
    assert [arm.wrist.name for arm in g1.arms] == ["L_ee", "R_ee"]
    assert all(arm.wrist.xyz == (0.05, 0.0, 0.0) for arm in g1.arms)
    assert len(g1.joints) == 29


def test_fields_are_read(tmp_path: Path) -> None:
    two = load_description(write(tmp_path, GOOD))
    assert two.arm_joints == ("a", "b", "c")
    assert two.arms[0].wrist.xyz == (0.1, 0.0, 0.0)
    assert two.joint("a").kp == 3.0
    assert two.joint("unmentioned").velocity == 10.0
    assert two.presets == {"openwbt": {"position": 50.0}}
    assert two.model == tmp_path / "two.xml"


def test_a_model_file_stands_for_the_toml_beside_it(tmp_path: Path) -> None:
    write(tmp_path, GOOD)
    assert load_description(tmp_path / "two.xml").name == "two"


MISTAKES = {
    "not TOML": (("name =", "name"), "cannot be read"),
    "no name": (('name = "two"', ""), "the file needs name"),
    "no model": (('"two.xml"', '"three.xml"'), "three.xml does not exist"),
    "one arm": (('side = "right"', 'side = "left"'), "needs two"),
    "joint twice": (('["c"]', '["c", "d", "c"]'), "joint c is listed twice"),
    "joint in both arms": (('["c"]', '["a", "c"]'), "joint a is listed twice"),
    "no joints": (('["c"]', "[]"), "right arm lists no joints"),
    "wrist not on the last joint": (('joint = "b"', 'joint = "a"'), "frame L must sit on the last joint b, not a"),
    "no wrist": (('[arms.wrist]\nname = "R"\njoint = "c"', ""), "right arm needs an"),
    "two numbers": (("[0.1, 0, 0]", "[0.1, 0]"), "xyz must be three numbers"),
    "text for a number": (("kp = 3", 'kp = "3"'), r"\[joints.a\] kp must be a finite number"),
    "unknown key": (("kp = 3", "stiffness = 3"), r"\[joints.a\] has no stiffness"),
    "negative": (("kp = 3", "kp = -3"), "kp must not be negative"),
}


@pytest.mark.parametrize(("edit", "words"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_named_in_one_line(tmp_path: Path, edit: tuple[str, str], words: str) -> None:
    assert edit[0] in GOOD
    path = write(tmp_path, GOOD.replace(*edit))
    with pytest.raises(RobotError, match=words) as error:
        load_description(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_an_unknown_robot_lists_the_packaged_ones() -> None:
    with pytest.raises(RobotError, match=r"no such robot description; packaged robots: .*g1"):
        load_description("r2d2")


CAPSULES = """
[collision]
margin = 0.02
ignored = [{ pair = ["hand", "trunk"], reason = "they never meet" }]
[[collision.capsules]]
name = "trunk"
body = "base"
from = [0, 0, 0]
to = [0, 0, 0.5]
radius = 0.1
[[collision.capsules]]
name = "hand"
body = "b"
from = [0.0, 0.0, 0.0]
to = [0.1, 0.0, 0.0]
radius = 0.04
"""


def test_capsules_are_read(tmp_path: Path) -> None:
    collision = load_description(write(tmp_path, GOOD + CAPSULES)).collision
    assert collision.margin == 0.02
    assert [capsule.name for capsule in collision.capsules] == ["trunk", "hand"]
    assert collision.capsules[0].end == (0.0, 0.0, 0.5)
    assert collision.capsules[1].body == "b"
    assert collision.capsules[1].radius == 0.04
    assert collision.ignored[0].pair == ("hand", "trunk")
    assert collision.ignored[0].reason == "they never meet"


def test_a_robot_without_collision_has_no_capsules(tmp_path: Path) -> None:
    assert load_description(write(tmp_path, GOOD)).collision == CollisionDescription()


def test_every_ignored_pair_of_the_g1_has_a_reason() -> None:
    collision = load_description("g1").collision
    assert len(collision.capsules) == 19
    assert all(len(entry.reason.split()) > 2 for entry in collision.ignored)


COLLISION_MISTAKES = {
    "no margin": (("margin = 0.02\n", ""), r"\[collision\] needs margin"),
    "negative margin": (
        ("margin = 0.02", "margin = -0.02"),
        r"\[collision\] needs margin, a number that is not negative",
    ),
    "unknown key": (
        ("margin =", "clearance ="),
        r"\[collision\] has no clearance; it may have margin, capsules, ignored",
    ),
    "unknown key of a capsule": (("radius = 0.1", "r = 0.1"), "a capsule has no r; it may have name, body, from, to"),
    "unknown key of a pair": (("reason =", "why ="), "an ignored pair has no why"),
    "not a list": (("ignored = [", "ignored = 3 # ["), r"\[collision\] ignored must be a list of tables"),
    "not a table": (("[{", '["hand", {'), "an ignored pair must be a table"),
    "no name": (('name = "hand"\n', ""), "a capsule needs name"),
    "no body": (('body = "b"\n', ""), "capsule hand needs body"),
    "no end": (("to = [0.1, 0.0, 0.0]\n", ""), "capsule hand needs to, three numbers"),
    "two numbers": (("to = [0.1, 0.0, 0.0]", "to = [0.1, 0.0]"), "capsule hand: to must be three numbers"),
    "no radius": (("radius = 0.04\n", ""), "capsule hand needs radius, a number above zero"),
    "radius zero": (("radius = 0.04", "radius = 0.0"), "capsule hand needs radius, a number above zero"),
    "name twice": (('name = "hand"', 'name = "trunk"'), "has two capsules named trunk"),
    "pair of a stranger": (('["hand"', '["foot"'), "an ignored pair names foot, which is not a capsule"),
    "pair of one": (('["hand", "trunk"]', '["hand"]'), "an ignored pair needs pair, the names of two capsules"),
    "pair with itself": (
        ('["hand", "trunk"]', '["hand", "hand"]'),
        "an ignored pair needs pair, the names of two capsules",
    ),
    "pair twice": (
        ("ignored = [", 'ignored = [{ pair = ["trunk", "hand"], reason = "again" }, '),
        r"\[collision\] ignores trunk and hand twice",
    ),
    "no reason": ((', reason = "they never meet"', ""), "the ignored pair hand and trunk needs a reason"),
    "empty reason": (("they never meet", " "), "the ignored pair hand and trunk needs a reason"),
}


@pytest.mark.parametrize(("edit", "words"), COLLISION_MISTAKES.values(), ids=COLLISION_MISTAKES.keys())
def test_a_mistake_in_collision_is_named_in_one_line(tmp_path: Path, edit: tuple[str, str], words: str) -> None:
    assert edit[0] in CAPSULES
    path = write(tmp_path, GOOD + CAPSULES.replace(*edit))
    with pytest.raises(RobotError, match=words) as error:
        load_description(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
