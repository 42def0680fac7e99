"""What page and server say to each other beside poses and images: JSON objects with a `type`, on the pose socket.

| from   | type    | fields                                                                                          |
|--------|---------|-------------------------------------------------------------------------------------------------|
| page   | `hello` | `page`: version of the page; `device`: what it runs on, in words                                |
| page   | `pong`  | `t_ms`: of the ping; `page_ms`: the page's clock when it answered                               |
| page   | `clear` | a person has looked at the fault                                                                |
| server | `ping`  | `t_ms`: the server's clock                                                                      |
| server | `hud`   | what to show: see `Hud`                                                                         |

On the video socket a page acknowledges each image that it has shown: `{"type": "shown", "seq": SEQ}`.

A page's message is at most 4096 bytes, its texts at most 200 characters; numbers are finite. Other fields and other
types are refused by name, in a `MessageError` of one line.
"""

import json
import math
from dataclasses import asdict, dataclass, field
from typing import Any

MAX_MESSAGE_BYTES = 4096
MAX_TEXT = 200


class MessageError(ValueError):
    """A text that is no message; says why, in one line."""


@dataclass(frozen=True, slots=True)
class Hello:
    """A page introduces itself.

    Attributes:
        page: Version of the page.
        device: What it runs on, in words.
    """

    page: str
    device: str


@dataclass(frozen=True, slots=True)
class Pong:
    """A page answers a ping.

    Attributes:
        t_ms: The server's clock, as in the ping [ms].
        page_ms: The page's clock when it answered [ms].
    """

    t_ms: float
    page_ms: float


@dataclass(frozen=True, slots=True)
class Clear:
    """A person has looked at the fault."""


@dataclass(frozen=True, slots=True)
class ArmHud:
    """What to show of an arm.

    Attributes:
        state: Its state: disarmed, aligning, active, hold, fault.
        reason: What led there; empty while active.
        position_error_mm: Distance of the wrist from its target at the answer [mm]; None without one.
        rotation_error_deg: Angle between them [degrees]; None without one.
        warning: What a person should know while it is active; empty where all is well.
        changes: How often the state has changed; a controller buzzes when it rises.
    """

    state: str = "disarmed"
    reason: str = ""
    position_error_mm: float | None = None
    rotation_error_deg: float | None = None
    warning: str = ""
    changes: int = 0


@dataclass(frozen=True, slots=True)
class Hud:
    """What to show.

    Attributes:
        left: The left arm.
        right: The right arm.
        note: What else a person should know, in one line; empty where all is well.
        latency_ms: Stages by name and their latency [ms]; None where one is not known yet.
    """

    left: ArmHud = field(default_factory=ArmHud)
    right: ArmHud = field(default_factory=ArmHud)
    note: str = ""
    latency_ms: dict[str, float | None] = field(default_factory=dict)


def hud_message(hud: Hud) -> str:
    """The text of a HUD."""
    return json.dumps({"type": "hud", **asdict(hud)}, allow_nan=False)


def ping_message(t_ms: float) -> str:
    """The text of a ping.

    Args:
        t_ms: The server's clock [ms].
    """
    return json.dumps({"type": "ping", "t_ms": t_ms}, allow_nan=False)


def read_page_message(text: str) -> Hello | Pong | Clear:
    """Read what a page says.

    Args:
        text: One message.

    Returns:
        The message.

    Raises:
        MessageError: It is none.
    """
    fields = read_object(text)
    match fields.pop("type", None):
        case "hello":
            return Hello(**_exactly(fields, page=_text, device=_text))
        case "pong":
            return Pong(**_exactly(fields, t_ms=finite, page_ms=finite))
        case "clear":
            return Clear(**_exactly(fields))
        case other:
            raise MessageError(f"there is no message of type {_shown(other)}: only hello, pong and clear")


def read_shown(text: str) -> int:
    """Read a page's acknowledgement.

    Args:
        text: The message.

    Returns:
        Number of the image shown.

    Raises:
        MessageError: It is none.
    """
    fields = read_object(text)
    seq = fields.get("seq")
    if fields.keys() != {"type", "seq"} or fields["type"] != "shown" or type(seq) is not int or not 0 <= seq < 2**32:
        raise MessageError('an acknowledgement is {"type": "shown", "seq": SEQ}')
    return seq


def read_object(text: str) -> dict[str, Any]:
    """Read a JSON object of bounded size.

    Args:
        text: The JSON.

    Raises:
        MessageError: It is none, or too large.
    """
    if len(text) > MAX_MESSAGE_BYTES:
        raise MessageError(f"a message has at most {MAX_MESSAGE_BYTES} bytes, not {len(text)}")
    try:
        document = json.loads(text)
    # Deep nesting exhausts the parser's stack; it is as little JSON to us as a missing bracket.
    except (ValueError, RecursionError):
        raise MessageError("a message must be JSON") from None
    if not isinstance(document, dict):
        raise MessageError("a message must be a JSON object")
    return document


def finite(value: Any, name: str) -> float:
    """Take a value as a finite number.

    Args:
        value: What JSON gave.
        name: Of the field, for the error.

    Raises:
        MessageError: It is none.
    """
    try:
        if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
            return float(value)
    except OverflowError:
        pass
    raise MessageError(f"{name} must be a finite number")


def _text(value: Any, name: str) -> str:
    if not isinstance(value, str) or len(value) > MAX_TEXT:
        raise MessageError(f"{name} must be a text of at most {MAX_TEXT} characters")
    return "".join(c if c.isprintable() else " " for c in value)


def _exactly(fields: dict[str, Any], **readers: Any) -> dict[str, Any]:
    strange = sorted(fields.keys() ^ readers.keys())
    if strange:
        verb = "is missing" if strange[0] in readers else "is not known"
        raise MessageError(f"field {_shown(strange[0])} {verb}")
    return {name: read(fields[name], name) for name, read in readers.items()}


def _shown(value: Any) -> str:
    return ascii(value)[:40]
