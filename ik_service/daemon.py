"""The daemon: one process, one event loop, up to three front ends on the same engine, one worker for what takes long.

Start: build and warm the engine, open TCP and Zenoh, then HTTP, then say "ready" with the bound addresses.
Stop, on SIGTERM or SIGINT: not ready any more, accept nothing new, answer what has arrived, close; within two seconds.
"""

import asyncio
import gc
import importlib
import json
import os
import secrets
import signal
import ssl
import sys
import time
from collections.abc import Coroutine
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from ik_proto import JSON
from ik_proto.host_port import HostPort
from ik_service.access import Doorkeeper
from ik_service.config import OFF, Config, ConfigError
from ik_service.conversation import Conversation
from ik_service.dispatcher import Dispatcher
from ik_service.engine import Engine
from ik_service.exposure import check_tcp_and_http, check_zenoh
from ik_service.logs import configure_logs, is_json, log, values
from ik_service.metrics import Metrics
from ik_service.openwbt import OpenwbtConnection
from ik_service.service import Service
from ik_service.tcp_server import Answerer, TcpServer
from ik_service.tls import server_context
from ik_service.token_file import read_token
from ik_service.worker import Worker

if TYPE_CHECKING:
    import zenoh

    from ik_service.http_server import HttpServer
    from ik_service.zenoh_server import ZenohServer


def serve(config: Config, started: float) -> None:
    """Serve until SIGTERM or SIGINT.

    Args:
        config: The settings.
        started: `time.perf_counter()` at the start of the program, for the start-up time in the ready line [s].

    Raises:
        RobotError: The robot cannot be loaded.
        ConfigError: A setting is wrong.
        AddressInUse: Another process listens on an address.
        DuplicateService: Another service of this robot is on the same Zenoh network.
        OSError: An address cannot be listened on.
    """
    configure_logs(config.log_format, config.log_level)
    signal.signal(signal.SIGTERM, _exit_at_once)  # until the event loop takes over
    access = _access(config)  # before the robot is built: a mistake in it should show at once
    engine = Engine.build(config, secrets.token_hex(6), version("ik-service"))
    if engine.kernel_note:
        log.warning("kernel", extra=values(kind=engine.about.kernel, reason=engine.kernel_note))
    engine.warm_up()
    # What lives now lives until the end: spare the garbage collector from looking at it again.
    gc.collect()
    gc.freeze()
    _run(Daemon(config, engine, access).run(started))


def _exit_at_once(*_: object) -> None:
    raise SystemExit(0)


def _run(main: Coroutine[Any, Any, None]) -> None:
    try:
        import uvloop
    except ModuleNotFoundError:  # not available on every platform
        asyncio.run(main)
    else:
        uvloop.run(main)


@dataclass(frozen=True, slots=True)
class Access:
    """How clients come in, and what they must show.

    Attributes:
        token: What every client must show; None for nothing.
        tls: TLS of the TCP endpoint; None for plain TCP.
        session: Configuration of the Zenoh session; None for no Zenoh.
    """

    token: bytes | None = field(repr=False)
    tls: ssl.SSLContext | None
    session: "zenoh.Config | None"


def _access(config: Config) -> Access:
    """Read what the settings name, and refuse an address that is exposed."""
    token = read_token(config.token_file, os.environ)
    check_tcp_and_http(config, token is not None)
    if token is not None and (config.smooth == "openwbt" or config.openwbt_lag):
        raise ConfigError("--smooth openwbt and --openwbt-lag are for OpenWBT's clients, and those cannot show a token")
    tls = server_context(config.tls_cert, config.tls_key, config.tls_client_ca) if config.tls_cert else None
    if config.zenoh == OFF:
        return Access(token, tls, None)
    from ik_service.zenoh_server import zenoh_config

    session = zenoh_config(config.zenoh, config.zenoh_connect, config.zenoh_config)
    check_zenoh(config, token is not None, session)
    return Access(token, tls, session)


class Daemon:
    """The front ends of one run."""

    def __init__(self, config: Config, engine: Engine, access: Access) -> None:
        """Take the settings, a warm engine, and how clients come in."""
        self._config = config
        self._access = access
        self._engine = engine
        self._worker, self._worker_engine = Worker(), engine.copy()
        about = engine.about
        self._metrics = Metrics(
            {"version": about.version, "robot": about.robot, "kernel": about.kernel, "boot_id": about.boot_id}
        )
        self._tcp: TcpServer | None = None
        self._zenoh: ZenohServer | None = None
        self._http: HttpServer | None = None

    async def run(self, started: float) -> None:
        """Open everything, wait for a signal, close everything."""
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, stop.set)
        try:
            self._announce(await self._start(), time.perf_counter() - started)
            await stop.wait()
            log.info("draining")
        finally:
            await self._stop()
        log.info("stopped")

    async def _start(self) -> dict[str, str]:
        """Open the front ends; give their addresses."""
        config, access, about = self._config, self._access, self._engine.about
        addresses = {}
        if config.tcp != OFF:
            self._tcp = self._tcp_server()
            addresses["tcp"] = str(await self._tcp.start(HostPort.parse(config.tcp), access.tls))
        if access.session is not None:
            from ik_service.zenoh_server import ZenohServer

            self._zenoh = ZenohServer.open(access.session, about.robot, about.boot_id, config.replica)
            self._zenoh.start(lambda: self._dispatcher(self._service("zenoh"), self._patient("zenoh"), remembers=False))
            addresses["zenoh"] = " ".join(self._zenoh.locators)
        if config.http != OFF:
            # Its packages take half a second to import. In a thread, so that robots are served meanwhile.
            module = await asyncio.to_thread(importlib.import_module, "ik_service.http_server")
            self._http = module.HttpServer(self._metrics, access.token)
            addresses["http"] = str(await self._http.start(HostPort.parse(config.http)))
            self._http.ready = True
        log.debug("front ends open", extra=values(boot_id=about.boot_id, **addresses))
        return addresses

    async def _stop(self) -> None:
        if self._http is not None:
            self._http.ready = False
        zenoh_closed = True
        if self._zenoh is not None:
            zenoh_closed = await asyncio.to_thread(self._zenoh.stop)
        if self._tcp is not None:
            await self._tcp.stop()
        if self._http is not None:
            await self._http.stop()
        worker_done = self._worker.stop(0.0)
        if not zenoh_closed or not worker_done:
            # Zenoh waits up to 10 s for a client that hangs, and again when the interpreter drops the session; and an
            # interpreter cannot be taken down under a thread that computes. All of ours is closed, so leave without
            # them.
            log.warning("leaving work behind", extra=values(zenoh_closed=zenoh_closed, worker_done=worker_done))
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(0)

    def _service(self, front_end: str) -> Service:
        return Service(self._engine.copy(), self._metrics.meter(front_end))

    def _patient(self, front_end: str) -> Service:
        return Service(self._worker_engine, self._metrics.meter(front_end))

    def _dispatcher(self, service: Service, patient: Service, remembers: bool) -> Dispatcher:
        return Dispatcher(service, patient, self._worker, doorkeeper=Doorkeeper(self._access.token, remembers))

    def _tcp_server(self) -> TcpServer:
        config, service, patient = self._config, self._service("tcp"), self._patient("tcp")
        smooth, lag = config.smooth == "openwbt", config.openwbt_lag

        def answerer() -> Answerer:
            dispatcher = self._dispatcher(service, patient, remembers=True)
            return OpenwbtConnection(dispatcher, smooth, lag) if smooth or lag else Conversation(dispatcher, JSON)

        server = TcpServer(answerer, partial(service.refuse_bytes, codec=JSON))
        self._metrics.closed["tcp"] = server.closed
        self._metrics.connections["tcp"] = lambda: server.connections
        return server

    def _announce(self, addresses: dict[str, str], startup_s: float) -> None:
        """Say that requests are served, in a form that a supervisor can read."""
        about = self._engine.about
        facts = {
            **addresses,
            "robot": about.robot,
            "preset": about.default_preset,
            "kernel": about.kernel,
            "boot_id": about.boot_id,
            "startup_s": round(startup_s, 3),
        }
        if is_json(self._config.log_format):
            print(json.dumps({"event": "ready", **facts}), flush=True)
        else:
            log.info("ready", extra=values(**facts))
