"""MessagePack over Zenoh: a session in client mode, and one query per request to one live replica.

- Replicas announce themselves by a liveliness token `ik/<robot>/alive/<boot_id>` and answer queries to
  `ik/<robot>/rpc/<boot_id>`. The client stays with one of them, and takes another when it is gone or silent: solving
  twice does no harm.
- An empty stream of replies means that the replica is gone; a hung one shows only by its silence. So as long as another
  is known, each gets half of the time that is left.
- Zenoh restores a lost link by itself; a session that never came about is opened again by the next request.
- No Python callback is ever left with Zenoh: one on an open session keeps the interpreter from exiting.
- A configuration of the user's own is passed through: TLS, user and password. What it sets, wins, its endpoints too.
"""

import contextlib
import json
import random
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import zenoh

from ik_client.access import NO_ACCESS, Access
from ik_client.address import Address
from ik_client.background import Background
from ik_client.backoff import Backoff
from ik_client.errors import ServiceUnavailable
from ik_proto import MSGPACK
from ik_proto.limits import DEFAULT_ZENOH

_CLOSE_SECONDS = 0.5
"""How long closing may keep the caller: towards a hung peer Zenoh takes 10 s."""

_SETTINGS = {
    "mode": "client",
    "listen/endpoints": [],
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/link/tx/lease": 2000,
    "connect/retry": {"period_init_ms": 20, "period_max_ms": 500, "period_increase_factor": 2},
}
"""Zenoh's settings, by path: only the address given, no discovery, a dead link noticed within 2 s and soon restored."""


class _Gone(Exception):
    """The replica asked is not there any more."""


class ZenohTransport:
    """Services behind `zenoh://HOST:PORT[/ROBOT]`, where a service or a router listens."""

    codec = MSGPACK
    shows_token = False

    def __init__(
        self, address: Address, clock: Callable[[], float] = time.monotonic, access: Access = NO_ACCESS
    ) -> None:
        """Remember where; open the session with the first request.

        Args:
            address: Where a service or a router is, and the robot to ask for.
            clock: Monotonic time [s].
            access: What to show; here, the configuration that is passed through.

        Raises:
            ValueError: The configuration cannot be read.
        """
        self._address = address
        self._clock = clock
        self._config = session_config(address.authority, access.zenoh_config)
        locator = f"tcp/{address.authority}"
        self._nobody = "nobody is there"
        self._serve = "ik-service serve" + ("" if locator == DEFAULT_ZENOH else f" --zenoh {locator}")
        if access.zenoh_config:  # Zenoh does not tell these apart
            self._nobody += f", or what {access.zenoh_config} shows is not accepted"
            self._serve = "ik-service serve --zenoh-config FILE"
        self._backoff = Backoff()
        self._opening: Background[zenoh.Session] | None = None
        self._session: zenoh.Session | None = None
        self._replicas: list[str] = []
        """Keys of the replicas known, the one in use first."""

    def request(self, body: bytes, deadline: float) -> bytes:
        """Send a request and wait for its reply; see `Transport.request`."""
        session = self._open(deadline)
        try:
            return self._ask_around(session, body, deadline)
        except zenoh.ZError:
            raise self._unavailable("the Zenoh session fails") from None

    def reset(self) -> None:
        """Choose a replica afresh."""
        self._replicas = []

    def close(self) -> None:
        """Close the session, or leave closing to a thread where that takes too long."""
        opening, self._opening = self._opening, None
        session, self._session = self._session, None
        if opening is not None:
            opening.abandon(_close)
        if session is not None:
            Background(lambda: _close(session)).wait(_CLOSE_SECONDS)

    def _open(self, deadline: float) -> zenoh.Session:
        """The session; opened in a thread, because opening towards a silent host takes long."""
        if self._session is not None:
            return self._session
        if self._opening is None:
            if self._backoff.pausing(self._clock()):
                raise self._unavailable(self._nobody)
            self._opening = Background(lambda: zenoh.open(self._config))
        if not self._opening.wait(deadline - self._clock()):
            raise TimeoutError
        opening, self._opening = self._opening, None
        try:
            self._session = opening.result()
        except zenoh.ZError:
            self._backoff.failed(self._clock())
            raise self._unavailable(self._nobody) from None
        self._backoff.succeeded()
        return self._session

    def _ask_around(self, session: zenoh.Session, body: bytes, deadline: float) -> bytes:
        for key, last in self._candidates(session, deadline):
            left = deadline - self._clock()
            if left <= 0.0:
                break
            try:
                return self._ask(session, key, body, left if last else 0.5 * left)
            except _Gone:
                self._replicas.remove(key)
            except TimeoutError:
                self._replicas.remove(key)
                self._replicas.append(key)
        if self._replicas or self._clock() >= deadline:
            raise TimeoutError
        robot = f" for robot {self._address.robot}" if self._address.robot else ""
        raise self._unavailable(f"no service answers{robot}")

    def _candidates(self, session: zenoh.Session, deadline: float) -> Iterator[tuple[str, bool]]:
        """The replicas to ask, each once, and whether it is the last one known; looks around once they are used up."""
        asked: set[str] = set()
        for look in (False, True):
            if look and self._clock() < deadline:
                fresh = [key for key in self._look_around(session, deadline) if key not in asked]
                self._replicas = fresh + self._replicas
            while untried := [key for key in self._replicas if key not in asked]:
                asked.add(untried[0])
                yield untried[0], len(untried) == 1

    def _look_around(self, session: zenoh.Session, deadline: float) -> list[str]:
        """Keys of the live replicas, in random order so that clients spread over them."""
        timeout = max(deadline - self._clock(), 0.001)
        tokens = session.liveliness().get(f"ik/{self._address.robot or '*'}/alive/*", timeout=timeout)
        alive = [str(token.ok.key_expr).split("/") for token in tokens if token.ok is not None]
        robots = sorted({robot for _, robot, _, _ in alive})
        if len(robots) > 1:
            raise ServiceUnavailable(
                self._address.url,
                f"serves several robots ({', '.join(robots)}); name one: zenoh://{self._address.authority}/{robots[0]}",
            )
        keys = [f"ik/{robot}/rpc/{boot_id}" for _, robot, _, boot_id in alive]
        random.shuffle(keys)
        return keys

    def _ask(self, session: zenoh.Session, key: str, body: bytes, timeout: float) -> bytes:
        """A replica's reply; raises `_Gone` or TimeoutError where there is none."""
        replies = session.get(
            key,
            payload=body,
            timeout=timeout,
            consolidation=zenoh.ConsolidationMode.NONE,
            congestion_control=zenoh.CongestionControl.DROP,
            express=True,
        )
        for reply in replies:
            if reply.ok is None:  # Zenoh's own word for a query that ran out of time
                raise TimeoutError
            return reply.ok.payload.to_bytes()
        raise _Gone

    def _unavailable(self, message: str) -> ServiceUnavailable:
        return ServiceUnavailable(self._address.url, f"{message}; start a service with: {self._serve}")


def session_config(authority: str, file: str = "") -> zenoh.Config:
    """Put together a session's configuration.

    Args:
        authority: Where a service or a router listens [host:port].
        file: The user's own configuration (JSON5); empty for none. What it sets to other than Zenoh's default is kept.

    Returns:
        The configuration.

    Raises:
        ValueError: The file cannot be read, or Zenoh does not take it.
    """
    defaults = zenoh.Config()
    try:
        config = zenoh.Config.from_json5(Path(file).read_text(encoding="utf-8")) if file else zenoh.Config()
        for path, value in {**_SETTINGS, "connect/endpoints": [f"tcp/{authority}"]}.items():
            if config.get_json(path) == defaults.get_json(path):
                config.insert_json5(path, json.dumps(value))
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"zenoh_config {file} cannot be read ({error})") from None
    except zenoh.ZError as error:
        raise ValueError(f"zenoh_config {file}: {_brief(error)}") from None
    return config


def _brief(error: Exception) -> str:
    """The first sentence of a Zenoh error, without the source location behind it."""
    return str(error).split(" at /", 1)[0].splitlines()[0]


def _close(session: zenoh.Session) -> None:
    with contextlib.suppress(zenoh.ZError):  # towards a hung peer it gives up with an error, and is closed
        session.close()
