"""Documents to requests and back: the one place where a request is validated, whatever carried it.

A request names its `verb` ("solve" where it is absent), may carry `id`, the protocol version `v` and an envelope, which
is checked here and used elsewhere, and has no other fields than its own: a misspelt or newer field is refused by name
rather than silently ignored. The one exception is a request in OpenWBT's form, recognised by `current_lr_arm_q`: its
extra keys are ignored, as OpenWBT's server does.
"""

from collections.abc import Callable
from typing import Any

from ik_proto.batches import parse_batch, parse_postures
from ik_proto.envelope import ENVELOPE_FIELDS, read_envelope
from ik_proto.errors import RequestError
from ik_proto.fields import as_floats, no_array, read_array, read_choice, read_id, read_integer, read_shaped, read_text
from ik_proto.hints import as_elbow, as_weights
from ik_proto.limits import DEFAULT_STARTS, MAX_ABS_JOINT, MAX_STARTS, OPENWBT_MARK, PROTOCOL_VERSION
from ik_proto.messages import (
    COLLISIONS,
    MODES,
    Array,
    ClearanceRequest,
    Document,
    FkRequest,
    InfoRequest,
    Request,
    SolveBatchRequest,
    SolveRequest,
    VelocityRequest,
)
from ik_proto.pose import EXACT, PoseError, as_pose, deviation, projected
from ik_proto.status import Status
from ik_proto.velocities import FIELDS as _VELOCITY
from ik_proto.velocities import parse_velocity, velocity_fields

_COMMON = frozenset({"verb", "id", "v"})
_PLAIN_SOLVE = _COMMON | {"left_wrist", "right_wrist", "q", "dq", "preset"}
_SOLVE = _PLAIN_SOLVE | {"mode", "waist", "left_elbow", "right_elbow", "weights", "collision", "starts"}
_FIELDS = {
    verb: fields | ENVELOPE_FIELDS
    for verb, fields in {
        "solve": _SOLVE,
        "solve_batch": _SOLVE,
        "fk": _COMMON | {"q", "waist"},
        "clearance": _COMMON | {"q", "waist"},
        "velocity": _COMMON | _VELOCITY,
        "info": _COMMON,
    }.items()
}
_OPENWBT_Q, _OPENWBT_DQ = OPENWBT_MARK, "current_lr_arm_dq"
_NO_OPTIONS: dict[str, Any] = {}


def parse_request(document: Document, n: int, n_waist: int = 3) -> Request:
    """Validate a decoded request.

    Args:
        document: What a codec decoded.
        n: Number of arm joints of the robot served.
        n_waist: Number of its waist joints.

    Returns:
        A typed request; rotations are projected onto SO(3), and elbow directions made unit vectors.

    Raises:
        RequestError: With the status, and the id and `q` where they could be read, for the reply to echo.
    """
    try:
        return _parse(document, n, n_waist)
    except RequestError:
        raise
    except ValueError as error:
        raise _refusal(document, n, str(error), Status.BAD_REQUEST) from None


def _parse(document: Document, n: int, n_waist: int) -> Request:
    version = document.get("v", PROTOCOL_VERSION)
    if version != PROTOCOL_VERSION:
        raise _refusal(
            document, n, f"protocol version {_brief(version)} is not served, this is version {PROTOCOL_VERSION}"
        )
    verb = document.get("verb", "solve")
    if not isinstance(verb, str) or verb not in _FIELDS:
        raise _refusal(document, n, f"verb {_brief(verb)} is not served, there are {', '.join(_FIELDS)}")
    # Nearly every request is a solve without options: one comparison tells, and spares it all that follows.
    plain = document.keys() <= _PLAIN_SOLVE
    if not plain and verb == "solve" and _OPENWBT_Q in document:
        document, plain = _from_openwbt(document), True
    elif not (plain and verb == "solve") and not document.keys() <= _FIELDS[verb]:
        unknown = next(name for name in document if name not in _FIELDS[verb])
        raise ValueError(f"{verb} has no field {str(unknown)[:40]!r}")
    if not plain:
        read_envelope(document)
    if verb == "info":
        return InfoRequest(id=read_id(document))
    if verb == "solve_batch":
        return parse_batch(document, n, n_waist)
    if verb == "clearance":
        return parse_postures(document, n, n_waist)
    if verb == "velocity":
        return parse_velocity(document, n, n_waist)
    q = read_array(document, "q", (n,), MAX_ABS_JOINT)
    if verb == "fk":
        return FkRequest(q=q, id=read_id(document), waist=_read_waist(document, n_waist))
    return SolveRequest(
        left_wrist=_read_pose(document, "left_wrist"),
        right_wrist=_read_pose(document, "right_wrist"),
        q=q,
        dq=read_array(document, "dq", (n,), MAX_ABS_JOINT),
        preset=read_text(document, "preset", "") or None,
        id=read_id(document),
        **(_NO_OPTIONS if plain else _read_options(document, n_waist)),
    )


def _from_openwbt(document: Document) -> Document:
    """Rename OpenWBT's fields to ours and drop what it does not know."""
    kept = {name: value for name, value in document.items() if name in _PLAIN_SOLVE}
    kept["q"] = document[_OPENWBT_Q]
    kept["dq"] = document.get(_OPENWBT_DQ)
    return kept


def _read_options(document: Document, n_waist: int) -> dict[str, Any]:
    """What few requests carry, so that the many without pay nothing for it."""
    return {
        "mode": read_choice(document, "mode", MODES, "track"),
        "waist": _read_waist(document, n_waist),
        "left_elbow": _read_optional(document, "left_elbow", (4,), as_elbow),
        "right_elbow": _read_optional(document, "right_elbow", (4,), as_elbow),
        "weights": _read_optional(document, "weights", (2, 2), as_weights),
        "collision": read_choice(document, "collision", COLLISIONS, None),
        "starts": read_integer(document, "starts", 1, MAX_STARTS, DEFAULT_STARTS),
    }


def _read_waist(document: Document, n_waist: int) -> Array | None:
    return None if document.get("waist") is None else read_array(document, "waist", (n_waist,), MAX_ABS_JOINT)


def _read_optional(
    document: Document, name: str, shape: tuple[int, ...], check: Callable[[Array], Array]
) -> Array | None:
    if document.get(name) is None:
        return None
    return _checked(name, check, read_array(document, name, shape))


def _read_pose(document: Document, name: str) -> Array:
    value = document.get(name)
    if type(value) is not list:
        return _checked(name, as_pose, read_shaped(document, name, (4, 4)))
    try:
        exact = deviation(value) <= EXACT
    except PoseError as error:
        raise ValueError(f"{name} {error}") from None
    except (TypeError, ValueError, OverflowError):
        raise no_array(value, name, (4, 4)) from None
    T = as_floats(value, name, (4, 4))
    return T if exact else projected(T)


def _checked(name: str, check: Callable[[Array], Array], array: Array) -> Array:
    try:
        return check(array)
    except ValueError as error:
        raise ValueError(f"{name} {error}") from None


def _brief(value: Any) -> str:
    """A value as it may be quoted; of one that holds others only its kind, since they may be nested without end."""
    return f"{value!r:.40}" if isinstance(value, str | int | float | None) else type(value).__name__


def _refusal(document: Document, n: int, message: str, status: Status = Status.UNSUPPORTED) -> RequestError:
    """A refusal that echoes as much of the request as is readable."""
    return RequestError(message, status, _readable_id(document), _readable_q(document, n))


def _readable_id(document: Document) -> int:
    try:
        return read_id(document)
    except ValueError:
        return 0


def _readable_q(document: Document, n: int) -> Array | None:
    """A single joint vector; the form of a refusal has no room for many of them."""
    if document.get("verb") in ("solve_batch", "clearance"):
        return None
    name = _OPENWBT_Q if _OPENWBT_Q in document else "q"
    try:
        return read_array(document, name, (n,), MAX_ABS_JOINT)
    except ValueError:
        return None


def request_document(request: Request) -> Document:
    """Put a request into the form a codec encodes.

    Args:
        request: Any request.

    Returns:
        Its document, arrays still numpy arrays.
    """
    document: Document = {"v": PROTOCOL_VERSION, "id": request.id}
    match request:
        case SolveRequest() | SolveBatchRequest():
            document |= {
                "verb": "solve" if isinstance(request, SolveRequest) else "solve_batch",
                "left_wrist": request.left_wrist,
                "right_wrist": request.right_wrist,
                "q": request.q,
            }
            if request.dq is not None:
                document["dq"] = request.dq
            if request.preset is not None:
                document["preset"] = request.preset
            if request.mode != "track":
                document["mode"] = request.mode
            if request.waist is not None:
                document["waist"] = request.waist
            if request.left_elbow is not None:
                document["left_elbow"] = request.left_elbow
            if request.right_elbow is not None:
                document["right_elbow"] = request.right_elbow
            if request.weights is not None:
                document["weights"] = request.weights
            if request.collision is not None:
                document["collision"] = request.collision
            if request.starts != DEFAULT_STARTS:
                document["starts"] = request.starts
        case FkRequest() | ClearanceRequest():
            document |= {"verb": "fk" if isinstance(request, FkRequest) else "clearance", "q": request.q}
            if request.waist is not None:
                document["waist"] = request.waist
        case VelocityRequest():
            document |= velocity_fields(request)
        case InfoRequest():
            document["verb"] = "info"
    return document
