"""Decides who answers a request: nobody who was not admitted, the thread it came to, or the worker.

A plain solve and a `velocity` are shorter than any hand-off and are answered at once. A batch, a solve in mode `reach`,
and whatever comes in a body so large that reading it takes long, go to the worker. A newer request of a stream
supersedes those of the same stream that still wait for the worker; bodies too large to be looked at here belong to no
stream.
"""

import contextlib
import math
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from ik_proto import Codec, DecodeError, Document, Status, read_envelope
from ik_proto.envelope import ENVELOPE_FIELDS
from ik_proto.fields import read_id
from ik_proto.limits import OPENWBT_MARK
from ik_proto.smoothing import WeightedMovingFilter
from ik_service.access import Doorkeeper
from ik_service.service import Service
from ik_service.worker import Busy, Job, Stream, Worker

LARGE_BODY_BYTES = 64 * 1024
"""Bodies beyond this are read by the worker; reading one of this size takes about 0.3 ms."""

_SUPERSEDED = "a newer request of its stream came while it waited"
_UNAUTHORIZED = "this service demands a token: send it in the field token"
_UNAUTHORIZED_UNREAD = "this service demands a token, in a request that is not larger than 64 KiB"


class Dispatcher:
    """Answers the requests of one connection or one queryable, in one thread.

    Attributes:
        hopeless: How many bodies in a row were none of a client worth listening to: undecodable, or not admitted.
    """

    def __init__(
        self,
        service: Service,
        patient: Service,
        worker: Worker,
        clock: Callable[[], float] = time.perf_counter,
        doorkeeper: Doorkeeper | None = None,
    ) -> None:
        """Put the parts together.

        Args:
            service: Answers in this thread; other dispatchers of this thread may share it.
            patient: Answers in the worker's thread; others may share it.
            worker: The thread for what takes long.
            clock: The services' clock [s].
            doorkeeper: Says whose requests are answered; None for everybody's.
        """
        self.hopeless = 0
        self._service = service
        self._patient = patient
        self._worker = worker
        self._clock = clock
        self._doorkeeper = doorkeeper or Doorkeeper(None, remembers=False)

    def answer(
        self, body: bytes, codec: Codec, arrived: float | None = None, smoothing: WeightedMovingFilter | None = None
    ) -> bytes | Future[bytes]:
        """Answer an encoded request. Never raises.

        Args:
            body: The request as it came.
            codec: How it and its reply are encoded.
            arrived: When it came, by the services' clock [s]; now where absent.
            smoothing: A filter the solved joints go through, for clients that expect it; not of what takes long.

        Returns:
            The encoded reply, or the one to come.
        """
        started = self._clock() if arrived is None else arrived
        if len(body) > LARGE_BODY_BYTES:
            if not self._doorkeeper.reads_unseen:
                self.hopeless += 1
                return self._service.refuse_bytes(Status.UNAUTHORIZED, _UNAUTHORIZED_UNREAD, codec)
            return self._later(partial(self._answer_large, body, codec, started), codec)
        try:
            document = codec.decode(body)
        except DecodeError as error:
            self.hopeless += 1
            return self._service.refuse_bytes(Status.BAD_REQUEST, str(error), codec)
        if not self._doorkeeper.admits(document):
            self.hopeless += 1
            return self._service.refuse_bytes(Status.UNAUTHORIZED, _UNAUTHORIZED, codec, _id_of(document))
        self.hopeless = 0
        stream, expires = "", math.inf
        if "stream" in document or "budget_ms" in document:
            stream, expires = _take_envelope(document, started)
            if stream:
                self._worker.supersede((self, stream))
        if _takes_long(document):
            job = partial(self._patient.handle_document, document, codec, started, expires)
            return self._later(job, codec, document, stream)
        return self._service.handle_document(document, codec, started, expires, smoothing)

    def refuse(self, body: bytes, codec: Codec, status: Status, message: str) -> bytes:
        """Refuse an encoded request that came in time but is not answered any more. Never raises.

        Args:
            body: The request as it came.
            codec: How it and its reply are encoded.
            status: Why, for a machine.
            message: Why, for a person.

        Returns:
            The encoded reply.
        """
        document: Document = {}
        if len(body) <= LARGE_BODY_BYTES:
            with contextlib.suppress(DecodeError):
                document = codec.decode(body)
        return self._service.refuse_bytes(status, message, codec, _id_of(document))

    def stream_of(self, body: bytes, codec: Codec) -> str:
        """Tell which stream a request that has to wait belongs to.

        Args:
            body: The request as it came.
            codec: How it is encoded.

        Returns:
            The stream's name; empty for none, for what cannot be read, and for what would not be admitted.
        """
        # Without this word it names none, unless JSON spells it with escapes.
        if b"stream" not in body and b"\\" not in body:
            return ""
        if len(body) > LARGE_BODY_BYTES or not self._doorkeeper.reads_unseen:
            return ""
        try:
            document = codec.decode(body)
            return read_envelope(document).stream if self._doorkeeper.admits(document) else ""
        except ValueError:
            return ""

    def supersede(self, stream: str) -> None:
        """Answer what waits for the worker and belongs to a stream, because something newer has come.

        Args:
            stream: Its name.
        """
        self._worker.supersede((self, stream))

    def _later(
        self, job: Job, codec: Codec, document: Document | None = None, stream: str = ""
    ) -> bytes | Future[bytes]:
        id = _id_of(document or {})
        superseded = partial(self._service.refuse_bytes, Status.SUPERSEDED, _SUPERSEDED, codec, id)
        try:
            return self._worker.submit(job, Stream((self, stream), superseded) if stream else None)
        except Busy as busy:
            return self._service.refuse_bytes(Status.OVERLOADED, str(busy), codec, id)

    def _answer_large(self, body: bytes, codec: Codec, started: float) -> bytes:
        """Answer a large body; the worker's thread calls."""
        try:
            document = codec.decode(body)
        except DecodeError as error:
            self.hopeless += 1
            return self._patient.refuse_bytes(Status.BAD_REQUEST, str(error), codec)
        if not self._doorkeeper.admits(document):
            self.hopeless += 1
            return self._patient.refuse_bytes(Status.UNAUTHORIZED, _UNAUTHORIZED, codec, _id_of(document))
        self.hopeless = 0
        _, expires = _take_envelope(document, started)
        return self._patient.handle_document(document, codec, started, expires)


def _take_envelope(document: Document, arrived: float) -> tuple[str, float]:
    """Take stream and end of the budget [s] out of a request; what is wrong stays, for the service to say so."""
    try:
        envelope = read_envelope(document)
    except ValueError:
        return "", math.inf
    for name in ENVELOPE_FIELDS:
        document.pop(name, None)
    return envelope.stream, math.inf if envelope.budget_ms is None else arrived + envelope.budget_ms * 1e-3


def _takes_long(document: Document) -> bool:
    # In OpenWBT's form a mode is one of the keys that are ignored.
    return document.get("verb") == "solve_batch" or (document.get("mode") == "reach" and OPENWBT_MARK not in document)


def _id_of(document: Document) -> int:
    try:
        return read_id(document)
    except ValueError:
        return 0
