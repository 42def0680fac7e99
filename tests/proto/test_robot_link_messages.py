"""The messages between a loop and a robot's end: round trips, refusals, and the fields of the types they carry."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_client import Command, RobotState
from ik_proto import JSON, DecodeError
from ik_proto.robot_link import (
    MAX_LINK_FRAME_BYTES,
    Hello,
    LinkCommand,
    LinkState,
    Welcome,
    command_document,
    hello_document,
    read_command,
    read_hello,
    read_state,
    read_welcome,
    state_document,
    welcome_document,
)
from ik_proto.wrist_motion import MAX_JOINT_NAME, WristMotion, motion_document, read_motion

PAGE = (Path(__file__).resolve().parents[2] / "proto" / "robot_link.md").read_text()
N = 3
COMMAND = LinkCommand(np.array([0.1, 0.2, 1 / 3]), np.zeros(N), 12.5, "run", 7, "boot", True, False)
MOTION = WristMotion(
    np.arange(12.0).reshape(2, 6) / 3.0,
    -np.arange(12.0).reshape(2, 6) / 7.0,
    np.array([0.03, 0.0]),
    ("", "joint"),
    (None, "right_elbow_joint"),
)
STATE = LinkState(
    np.array([0.1, 0.2, 1 / 3]), np.ones(N), 12.5, np.zeros(3), None, None, True, False, "a note", 0.25, "taking"
)


def names(kind) -> set[str]:
    return {field.name for field in dataclasses.fields(kind)}


def travel(document):
    return JSON.decode(JSON.encode(document))


def assert_same(a, b) -> None:
    for name in names(type(a)):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def test_messages_arrive_bit_for_bit():
    assert_same(read_command(travel(command_document(COMMAND)), N), COMMAND)
    assert_same(read_state(travel(state_document(STATE)), N), STATE)
    welcome = Welcome("g1", ("a", "b"), 0.02)
    assert read_welcome(travel(welcome_document(welcome))) == welcome
    seen = Welcome("g1", ("a", "b"), 0.02, "shm:ik-eyes-12346")
    assert read_welcome(travel(welcome_document(seen))) == seen
    assert read_hello(travel(hello_document(Hello(token="secret")))) == Hello(token="secret")
    assert "token" not in hello_document(Hello())


def test_a_motion_rides_on_a_command():
    command = dataclasses.replace(COMMAND, motion=MOTION)
    read = read_command(travel(command_document(command)), N)
    assert read.motion is not None
    assert_same(read.motion, MOTION)
    assert_same(dataclasses.replace(read, motion=None), COMMAND)


def test_a_robot_or_a_loop_that_knows_no_motion_misses_nothing():
    """An old loop sends none; an old robot reads only the fields it knows, and they are as they were."""
    assert "motion" not in command_document(COMMAND)
    assert read_command(travel(command_document(COMMAND)), N).motion is None
    assert read_command(travel(command_document(COMMAND)) | {"motion": None}, N).motion is None
    document = travel(command_document(dataclasses.replace(COMMAND, motion=MOTION)))
    del document["motion"]
    assert document == travel(command_document(COMMAND))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ([1.0], "motion must be an object"),
        ({"twists": None}, "motion: twists is missing"),
        ({"twists": [[0.0] * 6]}, "twists must have shape 2x6"),
        ({"achieved": [[0.0] * 6, [float("nan")] * 6]}, "not finite"),
        ({"achieved": [[0.0] * 6, [1e3] * 6]}, "beyond 141"),
        ({"manipulability": [0.1, -0.1]}, "must not be negative"),
        ({"limited_by": ["", "sloth"]}, "limited_by must be of"),
        ({"limited_by": [[], ""]}, "limited_by must be of"),
        ({"limiting_joint": ["x" * 65, None]}, "at most 64"),
        ({"limiting_joint": [3, None]}, "two names, or null"),
    ],
)
def test_a_motion_that_breaks_the_contract_gets_one_line(change, words):
    motion = travel(motion_document(MOTION))
    document = travel(command_document(COMMAND))
    document["motion"] = {**motion, **change} if isinstance(change, dict) else change
    with pytest.raises(ValueError, match=words) as error:
        read_command(document, N)
    assert "\n" not in str(error.value)


def test_a_message_carries_the_fields_of_its_type():
    assert names(LinkCommand) == names(Command)
    assert names(LinkState) == names(RobotState) | {"weight", "state"}


def test_the_page_names_every_field():
    for kind in (LinkCommand, LinkState, Welcome, WristMotion):
        missing = {name for name in names(kind) if not re.search(rf"`{name}`", PAGE)}
        assert not missing, kind


@pytest.mark.parametrize("block", re.findall(r"^```json\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL))
def test_the_examples_of_the_page_are_messages(block):
    document = json.loads(block)
    if "twists" in document:
        read_motion(document)
    elif "seq" in document:
        read_command(document, len(document["q"]))
    elif "q" in document:
        read_state(document, len(document["q"]))
    elif "joint_names" in document:
        read_welcome(document)
    else:
        read_hello(document)


def test_messages_of_a_large_robot_fit():
    n = 100
    q = np.random.default_rng(0).uniform(-3, 3, n)
    motion = dataclasses.replace(MOTION, limiting_joint=("j" * MAX_JOINT_NAME, "k" * MAX_JOINT_NAME))
    command = dataclasses.replace(COMMAND, q=q, tau=q, session="x" * 64, boot_id="y" * 64, motion=motion)
    state = dataclasses.replace(STATE, q=q, dq=q, q_set=q, note="n" * 300)
    assert len(JSON.encode(command_document(command))) < MAX_LINK_FRAME_BYTES
    assert len(JSON.encode(state_document(state))) < MAX_LINK_FRAME_BYTES


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("q", [0.0] * (N + 1), "q must have shape 3, not 4"),
        ("q", [0.0, float("nan"), 0.0], "not finite"),
        ("q", [0.0, 1e9, 0.0], "beyond"),
        ("tau", None, "tau is missing"),
        ("seq", -1, "seq must be an integer"),
        ("seq", True, "seq must be an integer"),
        ("session", "x" * 65, "at most 64"),
        ("boot_id", 3, "boot_id must be a string"),
        ("engaged", 1, "engaged must be true or false"),
        ("engaged", None, "engaged must be true or false"),
        ("release", "no", "release must be true or false"),
        ("time", float("inf"), "time must be a finite number"),
    ],
)
def test_a_command_that_breaks_the_contract_gets_one_line(field, value, words):
    """Hazard rows "NaN / Inf" and "malformed frame", on the way to the robot."""
    with pytest.raises(ValueError, match=words) as error:
        read_command({**travel(command_document(COMMAND)), field: value}, N)
    assert "\n" not in str(error.value)


def test_a_refusal_says_why():
    with pytest.raises(ValueError, match=r"^unauthorized: no$"):
        read_welcome({"error": "unauthorized: no"})


def test_a_robot_that_says_nothing_of_eyes_shows_nothing():
    document = travel(welcome_document(Welcome("g1", ("a",), 0.02)))
    del document["eyes"]
    assert read_welcome(document).eyes == ""


@pytest.mark.parametrize(("eyes", "words"), [(3, "eyes must be a string"), ("x" * 257, "at most 256")])
def test_what_is_no_place_of_eye_images(eyes, words):
    document = travel(welcome_document(Welcome("g1", ("a",), 0.02)))
    with pytest.raises(ValueError, match=words):
        read_welcome(document | {"eyes": eyes})


@pytest.mark.parametrize("document", [{}, {"v": 2}, {"v": True}, {"v": "1"}, {"v": 1, "token": 3}])
def test_what_is_no_hello(document):
    with pytest.raises(ValueError, match=r"hello|token"):
        read_hello(document)


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
CHANGED = st.dictionaries(st.sampled_from(sorted(names(LinkCommand) | names(LinkState))), ANYTHING, max_size=4)


@given(st.one_of(st.binary(max_size=60), CHANGED))
@settings(max_examples=200)
def test_anything_is_a_message_or_a_documented_error(change):
    """Hazard row "malformed frame", on the way to the robot and back."""
    if isinstance(change, bytes):
        with pytest.raises((DecodeError, ValueError)):
            read_command(JSON.decode(change), N)
        return
    for read, document in ((read_command, command_document(COMMAND)), (read_state, state_document(STATE))):
        try:
            message = read({**travel(document), **change}, N)
        except ValueError as error:
            assert "\n" not in str(error)
        else:
            assert np.isfinite(message.q).all()
