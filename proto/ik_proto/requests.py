"""Documents to requests and back: the one place where a request is validated, whatever carried it.

A request names its `verb` ("solve" where it is absent), may carry `id` and the protocol version `v`, and has no other
fields than its own: a misspelt or newer field is refused by name rather than silently ignored. The one exception is
a request in OpenWBT's form, recognised by `current_lr_arm_q`: its extra keys are ignored, as OpenWBT's server does.
"""

from ik_proto.errors import RequestError
from ik_proto.fields import read_array, read_id, read_shaped, read_text
from ik_proto.limits import MAX_ABS_JOINT, PROTOCOL_VERSION
from ik_proto.messages import Array, Document, FkRequest, InfoRequest, Request, SolveRequest
from ik_proto.pose import as_pose
from ik_proto.status import Status

_COMMON = frozenset({"verb", "id", "v"})
_FIELDS = {
    "solve": _COMMON | {"left_wrist", "right_wrist", "q", "dq", "preset"},
    "fk": _COMMON | {"q"},
    "info": _COMMON,
}
_OPENWBT_Q, _OPENWBT_DQ = "current_lr_arm_q", "current_lr_arm_dq"


def parse_request(document: Document, n: int) -> Request:
    """Validate a decoded request.

    Args:
        document: What a codec decoded.
        n: Number of arm joints of the robot served.

    Returns:
        A typed request; rotations are projected onto SO(3).

    Raises:
        RequestError: With the status, and the id and `q` where they could be read, for the reply to echo.
    """
    try:
        return _parse(document, n)
    except RequestError:
        raise
    except ValueError as error:
        raise _refusal(document, n, str(error), Status.BAD_REQUEST) from None


def _parse(document: Document, n: int) -> Request:
    version = document.get("v", PROTOCOL_VERSION)
    if version != PROTOCOL_VERSION:
        raise _refusal(
            document, n, f"protocol version {version!r:.20} is not served, this is version {PROTOCOL_VERSION}"
        )
    verb = document.get("verb", "solve")
    if not isinstance(verb, str) or verb not in _FIELDS:
        raise _refusal(document, n, f"verb {verb!r:.40} is not served, there are {', '.join(_FIELDS)}")
    if verb == "solve" and _OPENWBT_Q in document:
        document = _from_openwbt(document)
    elif not document.keys() <= _FIELDS[verb]:
        unknown = min(map(str, document.keys() - _FIELDS[verb]))
        raise ValueError(f"{verb} has no field {unknown[:40]!r}")
    if verb == "info":
        return InfoRequest(id=read_id(document))
    q = read_array(document, "q", (n,), MAX_ABS_JOINT)
    if verb == "fk":
        return FkRequest(q=q, id=read_id(document))
    return SolveRequest(
        left_wrist=_read_pose(document, "left_wrist"),
        right_wrist=_read_pose(document, "right_wrist"),
        q=q,
        dq=read_array(document, "dq", (n,), MAX_ABS_JOINT),
        preset=read_text(document, "preset", "") or None,
        id=read_id(document),
    )


def _from_openwbt(document: Document) -> Document:
    """Rename OpenWBT's fields to ours and drop what it does not know."""
    kept = {name: value for name, value in document.items() if name in _FIELDS["solve"]}
    kept["q"] = document[_OPENWBT_Q]
    kept["dq"] = document.get(_OPENWBT_DQ)
    return kept


def _read_pose(document: Document, name: str) -> Array:
    T = read_shaped(document, name, (4, 4))
    try:
        return as_pose(T)
    except ValueError as error:
        raise ValueError(f"{name} is not a pose: {error}") from None


def _refusal(document: Document, n: int, message: str, status: Status = Status.UNSUPPORTED) -> RequestError:
    """A refusal that echoes as much of the request as is readable."""
    return RequestError(message, status, _readable_id(document), _readable_q(document, n))


def _readable_id(document: Document) -> int:
    try:
        return read_id(document)
    except ValueError:
        return 0


def _readable_q(document: Document, n: int) -> Array | None:
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
        case SolveRequest():
            document |= {
                "verb": "solve",
                "left_wrist": request.left_wrist,
                "right_wrist": request.right_wrist,
                "q": request.q,
                "dq": request.dq,
            }
            if request.preset is not None:
                document["preset"] = request.preset
        case FkRequest():
            document |= {"verb": "fk", "q": request.q}
        case InfoRequest():
            document["verb"] = "info"
    return document
