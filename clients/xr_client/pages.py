"""The page's files and the CA's certificate over HTTP, with headers that keep the page to this server.

Every answer forbids the browser to load or connect to anything from elsewhere, to run code that is not in a file of
ours, and to show the page inside another one.
"""

import mimetypes
from collections.abc import Callable
from pathlib import Path

from aiohttp import web

WEB = Path(__file__).parent / "web"
"""Where the page's files are."""

HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob:; connect-src 'self'; object-src 'none'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "xr-spatial-tracking=(self), camera=(), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Server": "ik-xr",
}
_TYPES = {".js": "text/javascript", ".mjs": "text/javascript", ".css": "text/css", ".html": "text/html"}


class Pages:
    """Serves the files of a folder, read when asked for, and the CA's certificate."""

    def __init__(self, folder: Path = WEB, ca_der: bytes | None = None) -> None:
        """Look at nothing yet.

        Args:
            folder: The page's files.
            ca_der: The CA's certificate; None where there is none to install.
        """
        self._folder = folder.resolve()
        self._ca_der = ca_der

    def add_to(self, router: web.UrlDispatcher) -> None:
        """Add the routes; those of others must come first."""
        router.add_get("/ca.crt", self._ca)
        router.add_get("/{path:.*}", self._file)

    async def _ca(self, _: web.Request) -> web.Response:
        if self._ca_der is None:
            return web.Response(status=404, text="there is no certificate to install on this address\n")
        # Headsets offer to install a certificate of this type.
        return web.Response(body=self._ca_der, content_type="application/x-x509-ca-cert")

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info["path"] or "index.html"
        file = (self._folder / name).resolve() if "\0" not in name else self._folder
        if not (file.is_relative_to(self._folder) and file.is_file()):
            return web.Response(status=404, text="there is no such page here\n")
        kind = _TYPES.get(file.suffix) or mimetypes.guess_type(file.name)[0] or "application/octet-stream"
        charset = "utf-8" if kind.startswith("text/") else None
        return web.Response(body=file.read_bytes(), content_type=kind, charset=charset)


@web.middleware
async def with_headers(request: web.Request, handler: Callable) -> web.StreamResponse:
    """Add the headers to whatever is answered, refusals included; say no more about an error than its number."""
    try:
        response = await handler(request)
    except web.HTTPException as refusal:
        response = web.Response(status=refusal.status, text=f"{refusal.reason}\n")
    if not response.prepared:
        response.headers.update(HEADERS)
    return response
