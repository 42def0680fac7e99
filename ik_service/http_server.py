"""Health and metrics over HTTP, in the event loop that serves TCP: if it answers, that loop runs.

- `/healthz`: 200 while the process is alive.
- `/readyz`: 200 once the solver is warm and the transports listen; 503 before that and while draining.
- `/metrics`: the Prometheus text format. Where the service has a token, it is asked for in the header `Authorization:
  Bearer TOKEN`.

The first two say one word, and a container's health check should not have to hold the secret: they stay open.
"""

import errno
import hmac

from aiohttp import web

from ik_proto.host_port import HostPort
from ik_service.addresses import AddressInUse
from ik_service.metrics import Metrics
from ik_service.prometheus import MetricsPage


class HttpServer:
    """Three pages.

    Attributes:
        ready: Whether requests are served; set by the daemon.
    """

    def __init__(self, metrics: Metrics, token: bytes | None = None) -> None:
        """Start not ready.

        Args:
            metrics: What to show.
            token: What a reader of the metrics must show; None for nothing.
        """
        self.ready = False
        self._token = token
        self._page = MetricsPage(metrics)
        self._runner: web.AppRunner | None = None

    async def start(self, address: HostPort) -> HostPort:
        """Listen.

        Args:
            address: Where; port 0 lets the system choose.

        Returns:
            The address with the port that was chosen.

        Raises:
            AddressInUse: Another process listens there.
            OSError: The system does not allow it.
        """
        app = web.Application()
        app.router.add_get("/healthz", self._healthz)
        app.router.add_get("/readyz", self._readyz)
        app.router.add_get("/metrics", self._metrics_page)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.5)
        await self._runner.setup()
        try:
            await web.TCPSite(self._runner, address.host, address.port).start()
        except OSError as error:
            await self._runner.cleanup()
            if error.errno == errno.EADDRINUSE:
                raise AddressInUse(str(address), "--http") from None
            raise
        return HostPort(address.host, self._runner.addresses[0][1])

    async def stop(self) -> None:
        """Close."""
        if self._runner is not None:
            await self._runner.cleanup()

    async def _healthz(self, _: web.Request) -> web.Response:
        return web.Response(text="alive\n")

    async def _readyz(self, _: web.Request) -> web.Response:
        return web.Response(text="ready\n") if self.ready else web.Response(text="not ready\n", status=503)

    async def _metrics_page(self, request: web.Request) -> web.Response:
        if self._token is not None:
            # aiohttp hands on bytes that are no UTF-8 as lone surrogates.
            shown = request.headers.get("Authorization", "").encode(errors="surrogateescape")
            if not hmac.compare_digest(shown, b"Bearer " + self._token):
                return web.Response(
                    text="show the token: Authorization: Bearer TOKEN\n",
                    status=401,
                    headers={"WWW-Authenticate": "Bearer"},
                )
        return web.Response(
            body=self._page.render(), headers={"Content-Type": "text/plain; version=0.0.4; charset=utf-8"}
        )
