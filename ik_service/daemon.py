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
import sys
import time
from collections.abc import Callable, Coroutine
from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from ik_proto import JSON
from ik_service.addresses import HostPort
from ik_service.config import OFF, Config
from ik_service.dispatcher import Dispatcher
from ik_service.engine import Engine
from ik_service.logs import configure_logs, is_json, log, values
from ik_service.metrics import Metrics
from ik_service.openwbt import OpenwbtConnection
from ik_service.service import Service
from ik_service.tcp_server import Answer, TcpServer
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
        OSError: An address cannot be listened on.
    """
    configure_logs(config.log_format, config.log_level)
    signal.signal(signal.SIGTERM, _exit_at_once)  # until the event loop takes over
    session_config = _zenoh_config(config)  # before the robot is built: a mistake in it should show at once
    engine = Engine.build(config, secrets.token_hex(6), version("ik-service"))
    if engine.kernel_note:
        log.warning("kernel", extra=values(kind=engine.about.kernel, reason=engine.kernel_note))
    engine.warm_up()
    # What lives now lives until the end: spare the garbage collector from looking at it again.
    gc.collect()
    gc.freeze()
    _run(Daemon(config, engine, session_config).run(started))


def _exit_at_once(*_: object) -> None:
    raise SystemExit(0)


def _run(main: Coroutine[Any, Any, None]) -> None:
    try:
        import uvloop
    except ModuleNotFoundError:  # not available on every platform
        asyncio.run(main)
    else:
        uvloop.run(main)


def _zenoh_config(config: Config) -> "zenoh.Config | None":
    """Put together the Zenoh session's configuration, unless Zenoh is off."""
    if config.zenoh == OFF:
        return None
    from ik_service.zenoh_server import listen_locators, zenoh_config

    session_config = zenoh_config(config.zenoh, config.zenoh_connect, config.zenoh_config)
    for locator in listen_locators(session_config):
        config.check_locator(locator, "--zenoh-config")
    return session_config


class Daemon:
    """The front ends of one run."""

    def __init__(self, config: Config, engine: Engine, session_config: "zenoh.Config | None") -> None:
        """Take the settings, a warm engine, and the configuration of the Zenoh session if there is to be one."""
        self._config = config
        self._session_config = session_config
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
        config, about = self._config, self._engine.about
        addresses = {}
        if config.tcp != OFF:
            self._tcp = self._tcp_server()
            addresses["tcp"] = str(await self._tcp.start(HostPort.parse(config.tcp)))
        if self._session_config is not None:
            from ik_service.zenoh_server import ZenohServer

            self._zenoh = ZenohServer.open(self._session_config, about.robot, about.boot_id)
            self._zenoh.start(lambda: self._dispatcher(self._service("zenoh"), "zenoh"))
            addresses["zenoh"] = " ".join(self._zenoh.locators)
        if config.http != OFF:
            # Its packages take half a second to import. In a thread, so that robots are served meanwhile.
            module = await asyncio.to_thread(importlib.import_module, "ik_service.http_server")
            self._http = module.HttpServer(self._metrics)
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

    def _dispatcher(self, service: Service, front_end: str) -> Dispatcher:
        patient = Service(self._worker_engine, self._metrics.meter(front_end))
        return Dispatcher(service, patient, self._worker)

    def _tcp_server(self) -> TcpServer:
        config, service = self._config, self._service("tcp")
        smooth, lag = config.smooth == "openwbt", config.openwbt_lag

        answer: Answer = partial(self._dispatcher(service, "tcp").answer, codec=JSON)

        def plain() -> Answer:
            return answer

        def openwbt() -> Answer:
            return OpenwbtConnection(service, answer, smooth, lag).answer

        connection_answer: Callable[[], Answer] = openwbt if smooth or lag else plain
        server = TcpServer(connection_answer, partial(service.refuse_bytes, codec=JSON))
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
