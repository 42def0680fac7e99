"""MessagePack requests over Zenoh.

Two queryables answer the same requests: `ik/<robot>/rpc/<boot_id>` is this replica, `ik/<robot>/rpc` whichever replica
Zenoh finds first. The liveliness token `ik/<robot>/alive/<boot_id>` says that the replica is there. Zenoh does not
balance load: a client picks a live replica and fails over to another.

Each queryable is a FIFO and a thread of its own: a Python callback would block its link while it works, and keeps the
interpreter from exiting. The session is a peer with scouting, gossip and shared memory off; what a passed-through
configuration sets, wins.

Two services of one robot would take turns in leading it, so a service does not start beside another unless told to.
"""

import json
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path

import zenoh

from ik_proto import MAX_FRAME_BYTES
from ik_proto.host_port import HostPort
from ik_service.addresses import AddressInUse, locator_host
from ik_service.config import ConfigError
from ik_service.dispatcher import Dispatcher
from ik_service.query_pump import QueryPump, brief

_QUEUED_QUERIES = 256
"""A full queue would block the link that feeds it, so it is deep."""

_LEASE_MS = 2000
_ASK_S = 1.0
_GRACE_S = 0.3
_NOT_IN_TEXT = ("transport/link/tls/listen_private_key_base64", "transport/link/tls/connect_private_key_base64")
"""Secrets that a configuration leaves out when it is written down."""

_OURS = {
    "mode": "peer",
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/link/tx/lease": _LEASE_MS,  # [ms] Zenoh's own 10 s is too long to find out that a client is gone.
    "transport/link/rx/max_message_size": 2 * MAX_FRAME_BYTES,  # a body that is too large is answered, not dropped
}
"""What we set where the user's configuration leaves Zenoh's default."""


class DuplicateService(RuntimeError):
    """Another service of the same robot is alive on the same Zenoh network.

    Attributes:
        robot: The robot's name.
        boot_id: The other service's run.
    """

    def __init__(self, robot: str, boot_id: str) -> None:
        """Say who is there and how to go on."""
        super().__init__(
            f"robot {robot} is served on this Zenoh network already, by run {boot_id}: stop that one, "
            "or pass --replica to serve beside it"
        )
        self.robot = robot
        self.boot_id = boot_id


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
        self._pumps: list[QueryPump] = []
        self._token = None
        self._alive = f"ik/{robot}/alive/{boot_id}"

    @classmethod
    def open(
        cls,
        config: zenoh.Config,
        robot: str,
        boot_id: str,
        replica: bool = False,
        patience_s: float = 1.2 * _LEASE_MS * 1e-3,
    ) -> "ZenohServer":
        """Open a session; nothing is answered before `start`.

        Args:
            config: From `zenoh_config`.
            robot: The robot's name.
            boot_id: Random name of this run.
            replica: Whether to serve beside another service of this robot.
            patience_s: How long to wait for another one that may just have been killed [s].

        Returns:
            A server that listens.

        Raises:
            AddressInUse: Another process listens there.
            DuplicateService: Another service of this robot is alive on this network, and this is to be no replica.
            ConfigError: Zenoh refuses the configuration.
        """
        locators = listen_locators(config)
        try:
            session = zenoh.open(config)
        except zenoh.ZError as error:
            if "Address already in use" in str(error):
                raise AddressInUse(" ".join(locators), "--zenoh") from None
            raise ConfigError(f"Zenoh cannot listen on {' '.join(locators)}: {brief(error)}") from None
        if not replica:
            try:
                _refuse_duplicate(session, config, robot, patience_s)
            except DuplicateService:
                session.close()
                raise
        return cls(session, locators, robot, boot_id)

    def start(self, make_dispatcher: Callable[[], Dispatcher]) -> None:
        """Begin to answer.

        Args:
            make_dispatcher: Makes what answers in one thread; called once for each queryable.
        """
        for key in (f"{self._rpc}/{self._boot_id}", self._rpc):
            # complete=True: of several replicas on one key exactly one is asked, not all.
            queryable = self._session.declare_queryable(key, zenoh.handlers.FifoChannel(_QUEUED_QUERIES), complete=True)
            self._queryables.append(queryable)
            self._pumps.append(QueryPump(queryable.handler, key, make_dispatcher()))
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
            pump.finish(_GRACE_S)
        self._session.close()


def _refuse_duplicate(session: zenoh.Session, config: zenoh.Config, robot: str, patience_s: float) -> None:
    """Make sure that nobody serves this robot.

    A service that was killed can look alive until its lease is over, so one that is there is looked for again.

    Raises:
        DuplicateService: Somebody does, and still did when patience was over.
    """
    deadline = time.monotonic() + patience_s
    while (boot_id := _alive(session, config, robot)) is not None:
        if time.monotonic() >= deadline:
            raise DuplicateService(robot, boot_id)
        time.sleep(0.1)


def _alive(session: zenoh.Session, config: zenoh.Config, robot: str) -> str | None:
    """The boot_id of a service of this robot; None where there is none."""
    if (boot_id := _ask_alive(session, robot)) is not None:
        return boot_id
    if not json.loads(config.get_json("connect/endpoints")):
        return None
    # A router does not tell one peer of another that it could reach by itself. It tells clients, so ask as one.
    try:
        with zenoh.open(_client_of(config)) as client:
            return _ask_alive(client, robot)
    except zenoh.ZError:  # nobody there to ask
        return None


def _ask_alive(session: zenoh.Session, robot: str) -> str | None:
    for reply in session.liveliness().get(f"ik/{robot}/alive/*", timeout=_ASK_S):
        if reply.ok is not None:
            return str(reply.ok.key_expr).rpartition("/")[2]
    return None


def _client_of(config: zenoh.Config) -> zenoh.Config:
    """The same configuration for a session that only connects."""
    client = zenoh.Config.from_json5(str(config))
    changes = {key: config.get_json(key) for key in _NOT_IN_TEXT}
    for key, value in {**changes, "mode": '"client"', "listen/endpoints": "[]"}.items():
        if value != "null":
            client.insert_json5(key, value)
    return client


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
        raise ConfigError(f"{file or 'Zenoh'}: {brief(error)}") from None
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
