"""The messages between a teleop loop and a robot's own end, where these are two processes: `proto/robot_link.md`.

JSON documents in the frames of `framing`. As with requests and replies, what a reader returns can be trusted. Joint
vectors are in the order of the welcome's `joint_names`.
"""

from dataclasses import dataclass

from ik_proto.fields import read_array, read_integer, read_number, read_text
from ik_proto.limits import MAX_ID
from ik_proto.messages import Array, Document
from ik_proto.wrist_motion import WristMotion, motion_document, read_motion

LINK_VERSION = 1

MAX_LINK_FRAME_BYTES = 16 * 1024
"""Largest body either way [bytes]. A command for 14 joints takes 0.8 kB, with a motion 1.4 kB, a state 1.4 kB."""

MAX_LINK_NAME = 64
"""Longest name of a session or of a run of the service [characters]."""

MAX_EYES_URL = 256
"""Longest URL of eye images [characters]."""

_MAX_ABS = 1e4
"""Largest norm of a vector of joint positions [rad], velocities [rad/s] or torques [N m]."""


@dataclass(frozen=True, slots=True)
class Hello:
    """The first message of a loop.

    Attributes:
        version: Version of this protocol.
        token: The robot's secret; empty where it demands none.
    """

    version: int = LINK_VERSION
    token: str = ""


@dataclass(frozen=True, slots=True)
class Welcome:
    """The robot's answer to it.

    Attributes:
        robot: Its name.
        joint_names: Its arm joints, in the order of every vector.
        period: Time between two states, and between two commands it expects [s].
        eyes: URL of what its eyes see; empty where it shows nothing.
    """

    robot: str
    joint_names: tuple[str, ...]
    period: float
    eyes: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class LinkCommand:
    """What the robot shall do; the fields are those of `ik_client.Command`."""

    q: Array
    tau: Array
    time: float
    session: str
    seq: int
    boot_id: str
    engaged: bool
    release: bool
    motion: WristMotion | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LinkState:
    """What the robot measures and does; the fields are those of `ik_client.RobotState`, and two more.

    Attributes:
        weight: How much the set-point counts against the onboard controller's own, 0 to 1.
        state: The state of the robot's end, in a word.
    """

    q: Array
    dq: Array
    time: float
    waist: Array | None
    q_set: Array | None
    tau_set: Array | None
    ready: bool
    following: bool
    note: str
    weight: float
    state: str


def hello_document(hello: Hello) -> Document:
    """A hello as it travels."""
    return {"v": hello.version} | ({"token": hello.token} if hello.token else {})


def read_hello(document: Document) -> Hello:
    """Read a hello.

    Raises:
        ValueError: It is none, or of another version; one line.
    """
    version = document.get("v")
    if type(version) is not int or version != LINK_VERSION:
        raise ValueError(f"the first message must be a hello of version {LINK_VERSION}")
    return Hello(version, read_text(document, "token", ""))


def welcome_document(welcome: Welcome) -> Document:
    """A welcome as it travels."""
    document = {"v": LINK_VERSION, "robot": welcome.robot, "joint_names": list(welcome.joint_names)}
    return document | {"period": welcome.period, "eyes": welcome.eyes}


def read_welcome(document: Document) -> Welcome:
    """Read a welcome.

    Raises:
        ValueError: It is none, or a refusal: then its text.
    """
    if "error" in document:
        raise ValueError(read_text(document, "error"))
    names = document.get("joint_names")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise ValueError("joint_names must be a list of names")
    eyes = read_text(document, "eyes", "")
    if len(eyes) > MAX_EYES_URL:
        raise ValueError(f"eyes must have at most {MAX_EYES_URL} characters")
    return Welcome(read_text(document, "robot"), tuple(names), read_number(document, "period"), eyes)


def refusal_document(error: str) -> Document:
    """What a loop is told before its connection is closed."""
    return {"error": error}


def command_document(command: LinkCommand) -> Document:
    """A command as it travels; a motion that is not there takes no place."""
    document = {name: getattr(command, name) for name in LinkCommand.__slots__ if name != "motion"}
    return document if command.motion is None else document | {"motion": motion_document(command.motion)}


def read_command(document: Document, n: int) -> LinkCommand:
    """Read a command.

    Args:
        document: The message.
        n: Number of joints.

    Raises:
        ValueError: It is no command for so many joints; one line.
    """
    motion = document.get("motion")
    return LinkCommand(
        q=read_array(document, "q", (n,), _MAX_ABS),
        tau=read_array(document, "tau", (n,), _MAX_ABS),
        time=read_number(document, "time"),
        session=_name(document, "session"),
        seq=read_integer(document, "seq", 0, MAX_ID),
        boot_id=_name(document, "boot_id"),
        engaged=_flag(document, "engaged"),
        release=_flag(document, "release"),
        motion=None if motion is None else read_motion(motion),
    )


def state_document(state: LinkState) -> Document:
    """A state as it travels."""
    return {name: getattr(state, name) for name in LinkState.__slots__}


def read_state(document: Document, n: int) -> LinkState:
    """Read a state.

    Args:
        document: The message.
        n: Number of joints.

    Raises:
        ValueError: It is no state of so many joints; one line.
    """
    waist = document.get("waist")
    return LinkState(
        q=read_array(document, "q", (n,), _MAX_ABS),
        dq=read_array(document, "dq", (n,), _MAX_ABS),
        time=read_number(document, "time"),
        waist=None if waist is None else read_array(document, "waist", (_length(waist),), _MAX_ABS),
        q_set=None if document.get("q_set") is None else read_array(document, "q_set", (n,), _MAX_ABS),
        tau_set=None if document.get("tau_set") is None else read_array(document, "tau_set", (n,), _MAX_ABS),
        ready=_flag(document, "ready"),
        following=_flag(document, "following"),
        note=read_text(document, "note"),
        weight=read_number(document, "weight"),
        state=read_text(document, "state"),
    )


def _length(value: object) -> int:
    return len(value) if isinstance(value, list) else 0


def _name(document: Document, name: str) -> str:
    text = read_text(document, name)
    if len(text) > MAX_LINK_NAME:
        raise ValueError(f"{name} must have at most {MAX_LINK_NAME} characters")
    return text


def _flag(document: Document, name: str) -> bool:
    value = document.get(name)
    if not isinstance(value, bool):
        raise ValueError(f"{name} must be true or false")
    return value
