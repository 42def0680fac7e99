"""The thread that answers the queries of one Zenoh key.

It takes all that has come out of the channel before it answers the next, so that of the requests of one stream only the
newest is worked on, and the older are answered `superseded` at once. What takes long is answered from the worker's
thread, after later queries if need be.
"""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from functools import partial
from typing import cast

import zenoh

from ik_proto import MAX_FRAME_BYTES, MSGPACK, Status
from ik_service.dispatcher import Dispatcher
from ik_service.logs import log, values
from ik_service.stream_queue import StreamQueue, Waiting

_TAKEN = 256
"""Queries that may wait here; beyond that they wait in the channel, and then block the link that feeds it."""

_SUPERSEDED = "a newer request of its stream came while it waited"
_STOPPING = "the service is stopping; retry later"
_FAULT = "the service failed on this request; its log says why"


class QueryPump:
    """Answers the queries of one key until its channel is closed and empty."""

    def __init__(
        self,
        queries: zenoh.handlers.Handler[zenoh.Query],
        key: str,
        dispatcher: Dispatcher,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        """Start the thread.

        Args:
            queries: Where the queries come from.
            key: What they are answered on.
            dispatcher: What answers them; of this thread alone.
            clock: The dispatcher's clock [s].
        """
        self._queries = queries
        self._key = key
        self._dispatcher = dispatcher
        self._clock = clock
        self._queue = StreamQueue(partial(dispatcher.stream_of, codec=MSGPACK))
        self._coming: dict[Future[bytes], Waiting] = {}
        self._open = True
        self._thread = threading.Thread(target=self._run, name=f"zenoh {key}", daemon=True)
        self._thread.start()

    def finish(self, grace_s: float) -> None:
        """Answer everything that came; close the channel first.

        Args:
            grace_s: Time for what takes long [s]; what is not done by then is refused.
        """
        self._thread.join()
        wait(tuple(self._coming), grace_s)
        for late in tuple(self._coming):
            if (waiting := self._coming.pop(late, None)) is None:  # done at the last moment
                continue
            late.cancel()
            self._reply(waiting, self._dispatcher.refuse(waiting.body, MSGPACK, Status.OVERLOADED, _STOPPING))

    def _run(self) -> None:
        while self._open or len(self._queue):
            try:
                self._take_what_came()
                for old in self._queue.take_superseded():
                    self._reply(old, self._dispatcher.refuse(old.body, MSGPACK, Status.SUPERSEDED, _SUPERSEDED))
                if len(self._queue):
                    self._answer(self._queue.take())
            except Exception:  # a fault of ours must not take the thread along
                log.exception("no answer was made")

    def _take_what_came(self) -> None:
        """Wait for a query if none waits, and take those behind it."""
        try:
            if not len(self._queue):
                self._put(self._queries.recv(), self._clock())
            arrived = None
            while len(self._queue) < _TAKEN and (query := self._queries.try_recv()) is not None:
                if arrived is None:
                    arrived = self._clock()
                self._put(query, arrived)
        except zenoh.ZError:  # the channel is closed, and empty
            self._open = False

    def _put(self, query: zenoh.Query, arrived: float) -> None:
        payload = query.payload
        size = -1 if payload is None else len(payload)
        if payload is not None and size <= MAX_FRAME_BYTES:
            self._queue.put(Waiting(payload.to_bytes(), arrived, query))
            return
        fault = f"request of {size} bytes, at most {MAX_FRAME_BYTES} are accepted"
        message = "the query carries no request" if payload is None else fault
        refusal = self._dispatcher.refuse(b"", MSGPACK, Status.BAD_REQUEST, message)
        self._reply(Waiting(b"", arrived, query), refusal)

    def _answer(self, waiting: Waiting) -> None:
        try:
            reply = self._dispatcher.answer(waiting.body, MSGPACK, waiting.arrived)
        except Exception:
            log.exception("no answer was made")
            reply = self._dispatcher.refuse(waiting.body, MSGPACK, Status.INTERNAL, _FAULT)
        if isinstance(reply, bytes):
            self._reply(waiting, reply)
        else:
            self._coming[reply] = waiting
            reply.add_done_callback(self._came)

    def _came(self, reply: Future[bytes]) -> None:
        """Send what the worker made, or that it could not; its thread calls."""
        if (waiting := self._coming.pop(reply, None)) is None:  # refused meanwhile
            return
        if reply.cancelled():
            self._reply(waiting, self._dispatcher.refuse(waiting.body, MSGPACK, Status.OVERLOADED, _STOPPING))
        elif (fault := reply.exception()) is not None:
            log.error("no answer was made", exc_info=fault)
            self._reply(waiting, self._dispatcher.refuse(waiting.body, MSGPACK, Status.INTERNAL, _FAULT))
        else:
            self._reply(waiting, reply.result())

    def _reply(self, waiting: Waiting, body: bytes) -> None:
        with cast(zenoh.Query, waiting.asker) as query:  # a query that is not dropped leaves its client waiting
            try:
                query.reply(self._key, body)
            except zenoh.ZError as error:
                log.warning("reply not sent", extra=values(key=self._key, reason=brief(error)))


def brief(error: Exception) -> str:
    """The first sentence of a Zenoh error, without the source location behind it."""
    return str(error).split(" at /", 1)[0].splitlines()[0]
