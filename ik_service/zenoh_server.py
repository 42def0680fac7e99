"""MessagePack requests over Zenoh.

Two queryables answer the same requests: `ik/<robot>/rpc/<boot_id>` is this replica, `ik/<robot>/rpc` whichever replica
Zenoh finds first. The liveliness token `ik/<robot>/alive/<boot_id>` says that the replica is there. Zenoh does not
balance load: a client picks a live replica and fails over to another.

Each queryable is a FIFO and a thread of its own: a Python callback would block its link while it works, and keeps the
interpreter from exiting. What takes long is answered from the worker's thread, after later queries if need be. The
session is a peer with scouting, gossip and shared memory off; what a passed-through
configuration sets, wins.
"""

import json
import socket
import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from functools import partial
from pathlib import Path

import zenoh

from ik_proto import MAX_FRAME_BYTES, MSGPACK, Status
from ik_service.addresses import AddressInUse, HostPort, locator_host
from ik_service.config import ConfigError
from ik_service.dispatcher import Dispatcher
from ik_service.logs import log, values

_QUEUED_QUERIES = 256
"""A full queue would block the link that feeds it, so it is deep."""

_OURS = {
    "mode": "peer",
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/link/tx/lease": 2000,  # [ms] Zenoh's own 10 s is too long to find out that a client is gone.
    "transport/link/rx/max_message_size": 2 * MAX_FRAME_BYTES,  # a body that is too large is answered, not dropped
}
"""What we set where the user's configuration leaves Zenoh's default."""


class ZenohServer:
    """Serves one robot over one Zenoh session."""

    def __init__(self, session: zenoh.Session, locators: tuple[str, ...], robot: str, boot_id: str) -> None:
        """Take an open session; `open` makes one.

        Args:
            session: The session.
            locators: Where it listens.
            robot: The robot's name, part of the keys.
            boot_id: Random name of this run, part of the keys.
        """
        self.locators = locators
        self._session = session
        self._rpc = f"ik/{robot}/rpc"
        self._boot_id = boot_id
        self._queryables: list[zenoh.Queryable] = []
        self._pumps: list[threading.Thread] = []
        self._coming: set[Future[bytes]] = set()
        self._token = None
        self._alive = f"ik/{robot}/alive/{boot_id}"

    @classmethod
    def open(cls, config: zenoh.Config, robot: str, boot_id: str) -> "ZenohServer":
        """Open a session; nothing is answered before `start`.

        Args:
            config: From `zenoh_config`.
            robot: The robot's name.
            boot_id: Random name of this run.

        Returns:
            A server that listens.

        Raises:
            AddressInUse: Another process listens there.
            ConfigError: Zenoh refuses the configuration.
        """
        locators = listen_locators(config)
        try:
            session = zenoh.open(config)
        except zenoh.ZError as error:
            if "Address already in use" in str(error):
                raise AddressInUse(" ".join(locators), "--zenoh") from None
            raise ConfigError(f"Zenoh cannot listen on {' '.join(locators)}: {_brief(error)}") from None
        return cls(session, locators, robot, boot_id)

    def start(self, make_dispatcher: Callable[[], Dispatcher]) -> None:
        """Begin to answer.

        Args:
            make_dispatcher: Makes what answers in one thread; called once for each queryable.
        """
        for key in (f"{self._rpc}/{self._boot_id}", self._rpc):
            # complete=True: of several replicas on one key exactly one is asked, not all.
            queryable = self._session.declare_queryable(key, zenoh.handlers.FifoChannel(_QUEUED_QUERIES), complete=True)
            pump = threading.Thread(
                target=self._pump, args=(queryable.handler, key, make_dispatcher()), name=f"zenoh {key}", daemon=True
            )
            self._queryables.append(queryable)
            self._pumps.append(pump)
            pump.start()
        self._token = self._session.liveliness().declare_token(self._alive)

    def stop(self, timeout_s: float = 1.0) -> bool:
        """Take the token back, answer what has arrived, close.

        Args:
            timeout_s: Longest time to wait [s]. Closing can block for 10 s when a client hangs.

        Returns:
            Whether all of it was done in time.
        """
        closer = threading.Thread(target=self._close, name="zenoh close", daemon=True)
        closer.start()
        closer.join(timeout_s)
        return not closer.is_alive()

    def _close(self) -> None:
        if self._token is not None:
            self._token.undeclare()
        for queryable in self._queryables:
            queryable.undeclare()
        for pump in self._pumps:
            pump.join()
        wait(tuple(self._coming))
        self._session.close()

    def _pump(self, queries: zenoh.handlers.Handler[zenoh.Query], key: str, dispatcher: Dispatcher) -> None:
        """Answer queries until the queryable is undeclared and its queue empty."""
        while True:
            try:
                query = queries.recv()
            except zenoh.ZError:  # the channel is empty and closed
                return
            reply = _answer(dispatcher, query.payload)
            if isinstance(reply, bytes):
                _reply(query, key, reply)
            else:
                self._coming.add(reply)
                reply.add_done_callback(partial(self._came, query, key))

    def _came(self, query: zenoh.Query, key: str, reply: Future[bytes]) -> None:
        """Send what the worker made; its thread calls."""
        if reply.cancelled() or reply.exception() is not None:
            query.drop()
        else:
            _reply(query, key, reply.result())
        self._coming.discard(reply)


def _reply(query: zenoh.Query, key: str, body: bytes) -> None:
    with query:  # a query that is not dropped leaves its client waiting
        try:
            query.reply(key, body)
        except zenoh.ZError as error:
            log.warning("reply not sent", extra=values(key=key, reason=_brief(error)))


def _answer(dispatcher: Dispatcher, payload: zenoh.ZBytes | None) -> bytes | Future[bytes]:
    if payload is None:
        return dispatcher.refuse(Status.BAD_REQUEST, "the query carries no request", MSGPACK)
    if len(payload) > MAX_FRAME_BYTES:
        message = f"request of {len(payload)} bytes, at most {MAX_FRAME_BYTES} are accepted"
        return dispatcher.refuse(Status.BAD_REQUEST, message, MSGPACK)
    return dispatcher.answer(payload.to_bytes(), MSGPACK)


def zenoh_config(locator: str, connect: str = "", file: str = "") -> zenoh.Config:
    """Put together the session's configuration.

    A value of the file that differs from Zenoh's default is kept; everything else gets ours. A value that was written
    down but equals the default cannot be told from one that was not.

    Args:
        locator: Where to listen; port 0 takes a free one.
        connect: Locator of a router to join; empty for none.
        file: A JSON5 configuration; empty for none.

    Returns:
        The configuration.

    Raises:
        ConfigError: The file cannot be read, or Zenoh refuses a value.
        AddressError: The locator is none.
    """
    defaults = zenoh.Config()
    try:
        config = zenoh.Config.from_json5(Path(file).read_text(encoding="utf-8")) if file else zenoh.Config()
        ours = dict(_OURS, **{"listen/endpoints": [_with_port(locator)]})
        if connect:
            ours["connect/endpoints"] = [connect]
        for key, value in ours.items():
            if config.get_json(key) == defaults.get_json(key):
                config.insert_json5(key, json.dumps(value))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: cannot be read ({error})") from None
    except zenoh.ZError as error:
        raise ConfigError(f"{file or 'Zenoh'}: {_brief(error)}") from None
    return config


def listen_locators(config: zenoh.Config) -> tuple[str, ...]:
    """List where a session of this configuration listens."""
    endpoints = json.loads(config.get_json("listen/endpoints"))
    if isinstance(endpoints, dict):  # one list for each mode
        endpoints = endpoints.get(json.loads(config.get_json("mode")), [])
    return tuple(endpoints)


def _with_port(locator: str) -> str:
    """Replace port 0 by a free one, because Zenoh does not tell which port it took."""
    host = locator_host(locator)
    if host is None or host.port:
        return locator
    family = socket.AF_INET6 if ":" in host.host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.bind((host.host, 0))
        free = HostPort(host.host, probe.getsockname()[1])
    return locator.replace(str(host), str(free), 1)


def _brief(error: Exception) -> str:
    """The first sentence of a Zenoh error, without the source location behind it."""
    return str(error).split(" at /", 1)[0].splitlines()[0]
