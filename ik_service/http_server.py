"""Health and metrics over HTTP, in the event loop that serves TCP: if it answers, that loop runs.

- `/healthz`: 200 while the process is alive.
- `/readyz`: 200 once the solver is warm and the transports listen; 503 before that and while draining.
- `/metrics`: the Prometheus text format.
"""

import errno

from aiohttp import web

from ik_service.addresses import AddressInUse, HostPort
from ik_service.metrics import Metrics
from ik_service.prometheus import MetricsPage


class HttpServer:
    """Three pages.

    Attributes:
        ready: Whether requests are served; set by the daemon.
    """

    def __init__(self, metrics: Metrics) -> None:
        """Start not ready."""
        self.ready = False
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

    async def _metrics_page(self, _: web.Request) -> web.Response:
        return web.Response(
            body=self._page.render(), headers={"Content-Type": "text/plain; version=0.0.4; charset=utf-8"}
        )
