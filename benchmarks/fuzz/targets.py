"""What must hold of every message, whatever its bytes: accepted, or refused by a documented error of one line.

A target takes the bytes of one input. What the contract allows is counted; anything else escapes as an exception:
`Broken` where something was answered and the answer is wrong, else whatever the code under test raised.
"""

import math
import struct
import zlib
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, Protocol

import jsonschema
import numpy as np

from benchmarks.fuzz.examples import VECTORS
from ik_proto import (
    ANSWERS,
    JSON,
    BatchReply,
    ClearanceReply,
    ClearanceRequest,
    Codec,
    DecodeError,
    Document,
    FkRequest,
    FrameDecoder,
    FrameTooLarge,
    InfoRequest,
    ReplyError,
    Request,
    RequestError,
    SolveBatchRequest,
    SolveReply,
    SolveRequest,
    Status,
    VelocityReply,
    VelocityRequest,
    parse_batch_reply,
    parse_clearance_reply,
    parse_fk_reply,
    parse_info_reply,
    parse_request,
    parse_solve_reply,
    parse_velocity_reply,
    reply_document,
    request_document,
)
from ik_proto.limits import MAX_FRAME_BYTES

N, N_WAIST, ROWS = 14, 3, 2
LONGEST_MESSAGE = 400
"""Of an error that is one line for a person [characters]."""
AFFORDABLE = 8
"""Starts and rows of an accepted request that is still answered; the solver has benchmarks of its own."""
LATE_S = 20.0
"""When an answer that comes from the worker is taken as never coming [s]."""

_OF_ACCEPTED = {*ANSWERS, Status.UNSUPPORTED, Status.EXPIRED}
_OF_REFUSED = {Status.BAD_REQUEST, Status.UNSUPPORTED}

_SCHEMA = JSON.decode((VECTORS.parent / "schema" / "messages.schema.json").read_bytes())


Answer = Callable[[bytes], bytes | Future[bytes]]


class Broken(AssertionError):
    """What came back is not what the contract says."""


class Target(Protocol):
    """Something that takes hostile bytes."""

    counts: Counter[str]

    @property
    def frames(self) -> int:
        """How many bodies there were."""
        ...

    def __call__(self, data: bytes) -> None:
        """Take the bytes of one input; raise where the contract is broken."""
        ...


class Requests:
    """The service's side: a body is decoded, validated, answered, and the answer read as a client would."""

    def __init__(self, codec: Codec, answer: Answer | None = None, *, answered: int = 8, validated: int = 64) -> None:
        """Take what answers.

        Args:
            codec: How bodies are encoded.
            answer: Answers a body; None stops after validation.
            answered: One of so many bodies that were refused is sent through the service; of the accepted, all.
            validated: One of so many answers is held against the schema.
        """
        self.counts: Counter[str] = Counter()
        self.frames = 0
        self._codec = codec
        self._answered = answered
        self._validated = validated
        self._answer = answer

    def __call__(self, data: bytes) -> None:
        """Take one body."""
        self.frames += 1
        request, id = self._read(data)
        chosen = zlib.crc32(data)
        if self._answer is None:
            return
        if _cost(request) > AFFORDABLE:
            self.counts["accepted, too long to answer here"] += 1
        elif request is not None or chosen % self._answered == 0:
            reply = self._answer(data)
            self._check(reply if isinstance(reply, bytes) else _awaited(reply), request, id, chosen)

    def _read(self, body: bytes) -> tuple[Request | None, int]:
        """The request in a body, and its id where it has one."""
        try:
            document = self._codec.decode(body)
        except DecodeError as error:
            self.counts["refused: cannot be decoded"] += 1
            require_one_line(str(error))
            return None, 0
        document.pop("token", None)  # the service's doorkeeper takes it away, whatever it is
        try:
            request = parse_request(document, N, N_WAIST)
        except RequestError as error:
            self.counts[f"refused: {error.status}"] += 1
            require_one_line(str(error))
            return None, error.id
        self.counts[f"accepted: {type(request).__name__}"] += 1
        again = parse_request(self._codec.decode(self._codec.encode(request_document(request))), N, N_WAIST)
        require_same(again, request)
        return request, request.id

    def _check(self, reply: bytes, request: Request | None, id: int, chosen: int) -> None:
        document = self._codec.decode(reply)
        kind, read = _reply_kind(request, document)
        answer = read(document)
        self.counts[f"answered: {answer.status}"] += 1
        if answer.status is Status.INTERNAL:
            raise Broken("the service failed on this request")
        if answer.status not in (_OF_ACCEPTED if request is not None else _OF_REFUSED):
            raise Broken(f"{type(request).__name__} was answered {answer.status}")
        if answer.id != id:
            raise Broken(f"request {id} got reply {answer.id}")
        if not answer.success:
            require_one_line(answer.error)
        if chosen // 7 % self._validated == 0:
            plain = document if self._codec is JSON else JSON.decode(JSON.encode(reply_document(answer)))
            for error in _VALIDATORS[kind].iter_errors(plain):
                raise Broken(f"no {kind} by the schema: {error.message[:200]}")


class Replies:
    """The client's side: a body is decoded, and read as the reply to each kind of request."""

    def __init__(self, codec: Codec) -> None:
        """Take how bodies are encoded."""
        self.counts: Counter[str] = Counter()
        self.frames = 0
        self._codec = codec

    def __call__(self, data: bytes) -> None:
        """Take one body."""
        self.frames += 1
        try:
            document = self._codec.decode(data)
        except DecodeError as error:
            self.counts["refused: cannot be decoded"] += 1
            require_one_line(str(error))
            return
        for read in _READERS.values():
            try:
                reply = read(document)
            except ReplyError as error:
                self.counts["refused: no such reply"] += 1
                require_one_line(str(error))
                continue
            self.counts[f"accepted: {type(reply).__name__}"] += 1
            require_same(read(self._codec.decode(self._codec.encode(reply_document(reply)))), reply)


class Stream:
    """A TCP stream of frames, cut wherever the network likes, for a target that takes bodies."""

    def __init__(self, bodies: Target) -> None:
        """Take what the bodies go to."""
        self.counts = bodies.counts
        self._bodies = bodies

    @property
    def frames(self) -> int:
        """How many bodies there were."""
        return self._bodies.frames

    def __call__(self, data: bytes) -> None:
        """Take a stream."""
        decoder, got, refused = FrameDecoder(), [], False
        try:
            for piece in pieces(data):
                got += decoder.feed(piece)
        except FrameTooLarge as error:
            got += error.frames_before
            refused = True
            self.counts["refused: frame too large"] += 1
            require_one_line(str(error))
        expected = expected_frames(data)
        if (got, refused) != expected:
            raise Broken(f"{len(got)} frames came out of a stream of {len(expected[0])}")
        for body in got:
            self._bodies(body)


def pieces(data: bytes) -> list[bytes]:
    """Cut a stream into pieces, always the same for the same stream: one piece in half of the cases."""
    seed = zlib.crc32(data)
    if seed % 2:
        return [data]
    step = (1, 3, 4, 5, 64, 1447)[seed // 2 % 6]
    step = max(step, len(data) // 200)
    return [data[at : at + step] for at in range(0, len(data), step)]


def expected_frames(data: bytes) -> tuple[list[bytes], bool]:
    """The whole frames of a stream, and whether one beyond the limit ends it: said in the simplest way."""
    frames, at = [], 0
    while len(data) - at >= 4:
        (length,) = struct.unpack_from(">I", data, at)
        if length > MAX_FRAME_BYTES:
            return frames, True
        if len(data) - at - 4 < length:
            break
        frames.append(data[at + 4 : at + 4 + length])
        at += 4 + length
    return frames, False


def require_one_line(message: str) -> None:
    """Hold an error message to its promise: one short line, encodable, and nothing of the inside.

    Raises:
        Broken: It is not.
    """
    if not message or len(message) > LONGEST_MESSAGE or not message.isprintable():
        raise Broken(f"not one line for a person: {message[:500]!r}")
    if "Traceback" in message or "site-packages" in message:
        raise Broken(f"shows the inside: {message!r}")


def require_same(got: Any, sent: Any) -> None:
    """Hold a message that went through a codec to what it was, and all its numbers to being finite.

    Raises:
        Broken: A field differs or is not finite.
    """
    if type(got) is not type(sent):
        raise Broken(f"{type(sent).__name__} came out as {type(got).__name__}")
    for name in sent.__dataclass_fields__:
        a, b = getattr(got, name), getattr(sent, name)
        if isinstance(b, np.ndarray):
            # A projected rotation may change in its last bits once more.
            same = a.shape == b.shape and np.isfinite(b).all() and np.allclose(a, b, rtol=1e-12, atol=1e-12)
        else:
            same = a == b and not (isinstance(b, float) and not math.isfinite(b))
        if not same:
            raise Broken(f"{name} was {b!r:.80} and came out as {a!r:.80}")


def _cost(request: Request | None) -> int:
    match request:
        case SolveBatchRequest():
            return len(request.q) * (request.starts if request.mode == "reach" else 1)
        case SolveRequest():
            return request.starts if request.mode == "reach" else 1
        case _:
            return 0


def _awaited(reply: Future[bytes]) -> bytes:
    return reply.result(LATE_S)


def _reply_kind(request: Request | None, document: Document) -> tuple[str, Any]:
    """Schema and reader of the reply to a request; whatever was asked, a refusal has the form of a solve reply."""
    if document.get("status") not in ANSWERS:
        return "refusal", _READERS["solve_reply"]
    match request:
        case SolveBatchRequest():
            return "batch_reply", partial(parse_batch_reply, rows=len(request.q), n=N)
        case FkRequest():
            return "fk_reply", parse_fk_reply
        case ClearanceRequest():
            return "clearance_reply", partial(parse_clearance_reply, rows=len(request.q))
        case InfoRequest():
            return "info_reply", parse_info_reply
        case VelocityRequest():
            return "velocity_reply", _velocity_reply
        case _:
            return "solve_reply", _READERS["solve_reply"]


def _solve_reply(document: Document) -> SolveReply:
    return parse_solve_reply(document, N)


def _batch_reply(document: Document) -> BatchReply:
    return parse_batch_reply(document, ROWS, N)


def _clearance_reply(document: Document) -> ClearanceReply:
    return parse_clearance_reply(document, ROWS)


def _velocity_reply(document: Document) -> VelocityReply:
    return parse_velocity_reply(document, N)


_READERS: dict[str, Any] = {
    "solve_reply": _solve_reply,
    "batch_reply": _batch_reply,
    "fk_reply": parse_fk_reply,
    "clearance_reply": _clearance_reply,
    "info_reply": parse_info_reply,
    "velocity_reply": _velocity_reply,
}
_VALIDATORS = {
    kind: jsonschema.Draft202012Validator({"$defs": _SCHEMA["$defs"], "$ref": f"#/$defs/{kind}"})
    for kind in (*_READERS, "refusal")
}
