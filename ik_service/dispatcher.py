"""Decides who answers a request: the thread it came to, or the worker.

A plain solve is shorter than any hand-off and is answered at once. A batch, a solve in mode `reach`, and whatever comes
in a body so large that reading it takes long, go to the worker.
"""

import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from ik_proto import Codec, DecodeError, Document, Status
from ik_proto.fields import read_id
from ik_service.service import Service
from ik_service.worker import Busy, Job, Worker

LARGE_BODY_BYTES = 64 * 1024
"""Bodies beyond this are read by the worker; reading one of this size takes about 0.3 ms."""


class Dispatcher:
    """Answers the requests of one thread."""

    def __init__(
        self, service: Service, patient: Service, worker: Worker, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        """Put the parts together.

        Args:
            service: Answers in this thread.
            patient: Answers in the worker's thread; other services of that thread may share its engine.
            worker: The thread for what takes long.
            clock: The services' clock [s].
        """
        self._service = service
        self._patient = patient
        self._worker = worker
        self._clock = clock

    def answer(self, body: bytes, codec: Codec) -> bytes | Future[bytes]:
        """Answer an encoded request. Never raises.

        Args:
            body: The request as it came.
            codec: How it and its reply are encoded.

        Returns:
            The encoded reply, or the one to come.
        """
        if len(body) > LARGE_BODY_BYTES:
            return self._later(partial(self._patient.handle_bytes, body, codec), codec)
        started = self._clock()
        try:
            document = codec.decode(body)
        except DecodeError:
            return self._service.handle_bytes(body, codec)  # says what is wrong with it
        if _takes_long(document):
            job = partial(self._patient.handle_document, document, codec, started)
            return self._later(job, codec, document)
        return self._service.handle_document(document, codec, started)

    def refuse(self, status: Status, message: str, codec: Codec) -> bytes:
        """Encode and count a refusal of what cannot be read as a request."""
        return self._service.refuse_bytes(status, message, codec)

    def _later(self, job: Job, codec: Codec, document: Document | None = None) -> bytes | Future[bytes]:
        try:
            return self._worker.submit(job)
        except Busy as busy:
            return self._service.refuse_bytes(Status.OVERLOADED, str(busy), codec, _id_of(document or {}))


def _takes_long(document: Document) -> bool:
    return document.get("verb") == "solve_batch" or document.get("mode") == "reach"


def _id_of(document: Document) -> int:
    try:
        return read_id(document)
    except ValueError:
        return 0
